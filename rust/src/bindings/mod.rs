//! The Python module `poresynth._core`. Each function takes a view, releases the interpreter,
//! calls a kernel, maps the error and wraps the result; nothing else happens here.

mod cancellable;
mod components;
mod correlation;
mod euler;
mod geometry;
mod gray;
mod intensity;
mod points;
mod repair;
mod responses;
mod skeleton;
mod surface;
mod texture;
mod topology;
mod transport;

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;

use crate::error::Error;

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match &error {
            Error::Parameter { parameter, value, allowed } => Python::attach(|py| {
                let arguments = (*parameter, value.as_str(), allowed.as_str());
                py.import("poresynth.errors")
                    .and_then(|errors| errors.getattr("ParameterError")?.call1(arguments))
                    .map_or_else(|failed| failed, PyErr::from_value)
            }),
            Error::Cancelled => PyKeyboardInterrupt::new_err(()),
            Error::Threads(_) => PyRuntimeError::new_err(error.to_string()),
        }
    }
}

/// Kernels of poresynth. Private: use the functions of the package.
#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::components::{cavities, component_statistics, keep_parts};
    #[pymodule_export]
    use super::correlation::{
        local_porosity, novelty, run_lengths, two_point, two_point_cluster, two_point_map,
    };
    #[pymodule_export]
    use super::euler::{euler_corrected, euler_number};
    #[pymodule_export]
    use super::geometry::{distance_transform, local_thickness, signed_distance};
    #[pymodule_export]
    use super::gray::{binned_counts, gray_moments, level_counts, match_histogram};
    #[pymodule_export]
    use super::intensity::{cut_phases, cut_solid};
    #[pymodule_export]
    use super::points::point_distances;
    #[pymodule_export]
    use super::repair::{cell_perimeters, connect_phase, recount_phase, remove_branches};
    #[pymodule_export]
    use super::responses::{enlarge_periodic, match_responses, random_field};
    #[pymodule_export]
    use super::skeleton::{skeleton_graph, thin};
    #[pymodule_export]
    use super::surface::{secants, surface_area};
    #[pymodule_export]
    use super::texture::{
        MatchMap, carry_values, describe_windows, gaussian, match_windows, synthesize,
    };
    #[pymodule_export]
    use super::topology::{component_sizes, label};
    #[pymodule_export]
    use super::transport::{diffusivity, permeability};

    /// Version of the compiled kernels.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
