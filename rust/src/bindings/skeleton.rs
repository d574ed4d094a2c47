//! Thinning and the graph of a skeleton.

use ndarray::{Array2, aview2};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods,
    ToPyArray,
};
use pyo3::prelude::*;

use super::cancellable;
use crate::topology::skeleton_graph::graph;
use crate::topology::thinning::{self, Kind, Method};

/// What thinning leaves of the true voxels, in their memory order.
#[pyfunction]
#[pyo3(signature = (solid, *, kind, method, threads=0))]
pub(super) fn thin<'py>(
    py: Python<'py>,
    solid: PyReadonlyArray3<'py, bool>,
    kind: &str,
    method: &str,
    threads: usize,
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let kind: Kind = kind.parse()?;
    let method: Method = method.parse()?;
    let skeleton = PyArray3::zeros(py, solid.dims(), solid.is_fortran_contiguous());
    let solid = solid.as_array();
    let mut writable = skeleton.readwrite();
    let view = writable.as_array_mut();
    cancellable::run(py, threads, None, |monitor| {
        thinning::thin(solid, kind, method, view, monitor)
    })?;
    drop(writable);
    Ok(skeleton)
}

/// Centroids, kinds and sizes of the nodes; nodes and lengths of the branches; the branches' voxels
/// one after another, and where each branch's begin.
type Graph<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray1<i64>>,
);

/// The graph of the true voxels.
#[pyfunction]
#[pyo3(signature = (skeleton, voxel_size, *, threads=0))]
pub(super) fn skeleton_graph<'py>(
    py: Python<'py>,
    skeleton: PyReadonlyArray3<'py, bool>,
    voxel_size: [f64; 3],
    threads: usize,
) -> PyResult<Graph<'py>> {
    let skeleton = skeleton.as_array();
    let found =
        cancellable::run(py, threads, None, |monitor| graph(skeleton, voxel_size, monitor))?;
    let (nodes, branches) = (&found.nodes, &found.branches);
    let ends = branches.iter().flat_map(|b| b.nodes.map(i64::from)).collect::<Vec<_>>();
    let ends = Array2::from_shape_vec((branches.len(), 2), ends).unwrap_or_default();
    let starts = branches.iter().map(|b| b.start as i64);
    let vector = |values: Vec<i64>| values.to_pyarray(py);
    Ok((
        aview2(&nodes.iter().map(|n| n.place).collect::<Vec<_>>()).to_pyarray(py),
        nodes.iter().map(|n| n.kind as u8).collect::<Vec<_>>().to_pyarray(py),
        vector(nodes.iter().map(|n| i64::from(n.size)).collect()),
        ends.to_pyarray(py),
        branches.iter().map(|b| b.length).collect::<Vec<_>>().to_pyarray(py),
        aview2(&found.voxels).to_pyarray(py),
        vector(starts.chain([found.voxels.len() as i64]).collect()),
    ))
}
