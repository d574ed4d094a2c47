"""Connectivity pruning: loose ends, floating parts, closed pores (zhang_2017 §4.4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from poresynth.errors import ParameterError, PoresynthError
from poresynth.metrics import distance_transform
from poresynth.metrics.arguments import as_mask, as_scalar_volume
from poresynth.pruning.cut import Cut
from poresynth.pruning.elongation import Stock
from poresynth.pruning.gray import repaint
from poresynth.pruning.record import Pruned, Standing
from poresynth.pruning.spurs import Network
from poresynth.pruning.work import Work
from poresynth.volume import Volume, as_volume

__all__ = ["prune"]


BORDER = 2
"""Layers at the border of a periodic volume that stay: what touches across it is then the same."""
ROUNDS = 8
"""Most rounds of pruning: what was behind a branch may be a loose end once the branch is gone. The
fifth round found nothing in bone, Berea sandstone and foam."""


def prune(
    volume: Volume | npt.ArrayLike,
    *,
    exemplar: Volume | npt.ArrayLike | None = None,
    threshold: float | None = None,
    solid: Literal["bright", "dark"] = "bright",
    theta: float = 0.11,
    target: Literal["zero", "exemplar"] = "zero",
    parts: Literal["join", "remove", "keep"] = "join",
    pores: Literal["keep", "close"] = "keep",
    open_axes: Sequence[Literal["z", "y", "x"]] = (),
    boundary: Literal["open", "periodic"] = "open",
    free: npt.NDArray[np.bool_] | None = None,
    domain: npt.NDArray[np.bool_] | None = None,
    porosity_tolerance: float = 1e-3,
    threads: int = 0,
    progress: Callable[[str, float], object] | None = None,
) -> Pruned:
    """Remove or connect what hangs loose in a volume.

    The skeleton of the solid is a graph. A branch b with a free end, at a cell (loop) of perimeter
    L, is removed from the volume if its length is below θ·L; a longer one is grown to the strut
    before it by a copy of that branch of the exemplar that is likest in length, thickness and
    direction, with its cross-section and its gray values (zhang_2017 §4.4). Then the surface moves
    by single voxels until the porosity is what it was.

    Parameters
    ----------
    volume : Volume or array_like
        Gray, binary or labels, shape (z, y, x).
    exemplar : Volume or array_like, optional
        What the volume was made of: branches are copied from it, and ``target`` may be its own. The
        volume itself gives the branches otherwise.
    threshold : float, optional
        Gray value that parts pore from solid in both; Otsu's of the exemplar, or else of the
        volume. Of labels, all but the lowest are solid.
    solid : {"bright", "dark"}, default "bright"
        Which side of the threshold is solid.
    theta : float, default 0.11
        θ, from 0 (grow every loose end) up: the paper's value.
    target : {"zero", "exemplar"}, default "zero"
        ``"zero"``: every loose end goes or grows. ``"exemplar"``: as many remain, by volume, as the
        exemplar has, and the Euler number by volume approaches the exemplar's, too: branches grow
        only while it is too high, are removed when it is not, and where it is too low, loops are
        cut at their thinnest branches.
    parts : {"join", "remove", "keep"}, default "join"
        What becomes of parts of the solid that hang together with nothing: those of at least 10
        voxels are joined and smaller ones removed, all are removed, or all stay.
    pores : {"keep", "close"}, default "keep"
        Whether pores that do not reach the border are filled.
    open_axes : sequence of {"z", "y", "x"}, default ()
        Axes along which the pore must lead from face to face; a way is opened where it does not.
    boundary : {"open", "periodic"}, default "open"
        Whether the solid goes on at the opposite face. If so, the two outermost layers of voxels
        stay as they are, so that the volume still tiles.
    free : numpy.ndarray of bool, optional
        Voxels that may change, shape (z, y, x); all by default.
    domain : numpy.ndarray of bool, optional
        Where the material is, shape (z, y, x); everywhere by default. Its surface cuts struts as
        the border of a volume does: their ends are not loose. Nothing outside changes.
    porosity_tolerance : float, default 0.001
        Most by which the porosity may change. It is restored to the voxel wherever the surface
        allows; a volume of which so much is removed that it cannot be is an error.
    threads : int, default 0
        Number of threads; 0 takes all cores. The result does not depend on it.
    progress : callable, optional
        ``progress(stage, fraction)``; an exception in it stops the work.

    Returns
    -------
    Pruned
        The volume, every edit, and how the structure stood before and after.

    Raises
    ------
    ParameterError
        If a parameter is outside its range, or ``target`` is ``"exemplar"`` without an exemplar.
    PoresynthError
        If the porosity would change by more than ``porosity_tolerance``.

    Notes
    -----
    What hung together still does: branches with a free end are taken voxel by voxel, and only
    voxels whose removal leaves components, tunnels and cavities as they are; a loop is cut only
    where both sides hang together elsewhere. The same volume and parameters give the same result.
    Distances and radii are in voxels, lengths of branches in the unit of the voxel size.

    Peak memory: about 40 bytes a voxel.
    """
    whole = as_volume(volume)
    array = as_scalar_volume(whole, "volume")
    _check(theta, target, parts, pores, boundary, open_axes, exemplar, porosity_tolerance)
    example = None if exemplar is None else as_volume(exemplar)
    cut = Cut.of(array, example, threshold, solid)
    before = cut.solid(array)
    free = as_mask("free", free, array.shape)
    domain = as_mask("domain", domain, array.shape)
    report = progress or (lambda stage, fraction: None)
    report("measuring the structure", 0.0)
    if boundary == "periodic":
        free = _inside(array.shape) if free is None else free & _inside(array.shape)
    inside = None
    if domain is not None:
        free = domain if free is None else free & domain
        inside = distance_transform(domain, threads=threads)
    work = Work(before.copy(), free, whole.voxel_size, boundary, inside, threads)
    stood = work.standing()
    goal = None
    stock = None
    if example is not None:
        model = cut.solid(as_scalar_volume(example, "exemplar"))
        goal = Standing.of(model, threads=threads)
        stock = Stock.of(model, Network.of(model, whole.voxel_size, threads=threads))
    if 0 < before.sum() < before.size:
        work.mend_parts(parts)
        aim = goal if target == "exemplar" else None
        for number in range(ROUNDS):
            report("pruning branches", 0.1 + 0.6 * number / ROUNDS)
            if not work.prune_branches(theta, aim, stock):
                break
        report("pores", 0.75)
        work.fill_new_pores(before)
        if pores == "close":
            work.close_pores()
        for axis in open_axes:
            work.open_axis("zyx".index(axis))
        if target == "exemplar" and goal is not None:
            report("cutting loops", 0.8)
            work.cut_loops(goal)
        report("restoring the porosity", 0.85)
        work.restore(int(before.sum()))
    change = abs(float(work.solid.mean() - before.mean()))
    if change > porosity_tolerance:
        raise PoresynthError(
            f"pruning would change the porosity by {change:.2g}, more than porosity_tolerance = "
            f"{porosity_tolerance:g}: so much was removed that its surface cannot make up for it; "
            "allow more, or keep parts"
        )
    report("values", 0.9)
    values = repaint(array, before, work.solid, gray=cut.gray, keep=None if free is None else ~free)
    work.paint_growth(values, array if example is None else np.asarray(example.array), cut)
    after = work.standing()
    report("done", 1.0)
    return Pruned(
        whole.with_array(values),
        work.solid,
        before,
        tuple(work.edits),
        stood,
        after,
        goal,
        work.loose,
    )


def _inside(shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
    """Return the voxels that are away from the border."""
    inside = np.zeros(shape, bool)
    inside[BORDER:-BORDER, BORDER:-BORDER, BORDER:-BORDER] = True
    return inside


def _check(
    theta: float,
    target: str,
    parts: str,
    pores: str,
    boundary: str,
    open_axes: Sequence[str],
    exemplar: object,
    tolerance: float,
) -> None:
    if not 0 <= theta < np.inf:
        raise ParameterError("theta", theta, "must be 0 or above")
    for name, value, allowed in (
        ("target", target, ("zero", "exemplar")),
        ("parts", parts, ("join", "remove", "keep")),
        ("pores", pores, ("keep", "close")),
        ("boundary", boundary, ("open", "periodic")),
    ):
        if value not in allowed:
            raise ParameterError(name, value, f"must be one of {', '.join(allowed)}")
    if any(axis not in ("z", "y", "x") for axis in open_axes):
        raise ParameterError("open_axes", tuple(open_axes), "must be among z, y, x")
    if target == "exemplar" and exemplar is None:
        raise ParameterError("target", target, "needs an exemplar")
    if not 0 <= tolerance <= 1:
        raise ParameterError("porosity_tolerance", tolerance, "must be from 0 to 1")
