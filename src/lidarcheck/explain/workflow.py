"""The gap workflow: find where model and measurement disagree, name the missing effect, add it, show the gap shrink."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from lidarcheck.cases.chance import check_chance
from lidarcheck.explain.decision.answer import explanation_of
from lidarcheck.explain.progress import ignore_progress, ignore_step
from lidarcheck.explain.report.explanation import Explanation, ProgressCallback, StepCallback
from lidarcheck.explain.steps import Workflow
from lidarcheck.inference.wasserstein import Scale
from lidarcheck.workers import Processes, WorkerPool, one_blas_thread
from lidarcheck.workers.cores import usable_cores
from lidarcheck.workers.threads import in_threads

if TYPE_CHECKING:
    from lidarcheck.cases.case import Case
    from lidarcheck.workers.checkpoint import Checkpoint

__all__ = ["explain"]


def explain(
    case: Case,
    *,
    seed: int = 0,
    exclude: Sequence[str] = (),
    jobs: int = 1,
    pool: WorkerPool | None = None,
    on_progress: ProgressCallback | None = None,
    on_step: StepCallback | None = None,
    checkpoint: Checkpoint | None = None,
    calibrate: bool = True,
) -> Explanation:
    """Explain a case; the same case and seed give the same answer, whoever works: `jobs` processes, or a `pool`.

    `exclude`: effects that are not to be named. `on_progress` hears (step, done, of), `on_step` what
    is found, in words, as soon as it is there. `checkpoint` keeps what was done, so that
    an interrupted run goes on. Without `calibrate` nothing but the effects that are named changes in the model; usual
    errors are forgiven all the same. `UsageError` where there are fewer than three frames.
    """
    check_chance(case.model, case.frames, case.model_file)
    own = Processes(jobs, _wake)
    with one_blas_thread(), own if pool is None else contextlib.nullcontext(pool) as workers, _threads(workers):
        return _explain(
            case,
            Workflow(
                case.model,
                seed,
                tuple(exclude),
                workers,
                on_progress or ignore_progress,
                on_step or ignore_step,
                checkpoint,
                calibrate,
                case.origin,
            ),
        )


def _threads(pool: WorkerPool) -> contextlib.AbstractContextManager[None]:
    """As many threads as there are cores here for the pool, for what stands between its tasks."""
    return in_threads(min(pool.jobs, usable_cores()))


def _wake() -> None:
    """Load what every task needs."""
    import scipy.linalg
    import scipy.sparse  # noqa: F401

    from lidarcheck.model.exact import kernel  # noqa: F401


def _explain(case: Case, run: Workflow) -> Explanation:
    """The method, a step a line. Frames that verify are looked at in `verify` alone, when all is decided."""
    split = run.split(case)
    split, bench = run.exchange_frames(split, run.measure_residuals_and_floor(split))
    where = run.find_where(bench)
    screened, bench = run.screen_candidates(bench)
    search = run.fit_and_select(bench, screened)
    seen = Scale.of((*split.fit, *split.select), case.model, 2 * run.seed + 4)
    search = run.look_again(bench, seen, search, screened)
    search = run.leave_out_needless(bench, seen, search)
    search, answer = run.judge(bench, seen, search)
    search, answer = run.take_another_way(bench, seen, screened, search, answer)
    answer = run.withhold(bench, seen, search, answer)
    answer = run.withhold_taken_up(bench, seen, search, answer)
    answer = run.doubt_no_gap(bench, seen, search, answer)
    untestable = run.list_untestable(bench, screened)
    verified = run.verify(split.verify, answer)
    return explanation_of(case, split, bench, where, search, answer, untestable, verified, run.seed, run.steps)
