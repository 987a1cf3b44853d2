"""From a folder of meshes to a dataset: in parallel, resumable, naming what it cannot use.

What each file gives:

- a mesh of quads only: samples with ground truth, see ``targets.py``, several a shape;
- a triangle mesh with a field file of the same stem beside it, or with the quads that some remesher
  made of it (``NAME_quads``, see ``pairs.py``): one sample with that truth;
- any other triangle mesh: one sample without truth; its operators also go to the cache that
  ``predict`` looks into.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from vhquad.errors import DatasetError, VhquadError
from vhquad.learn.dataset import Dataset, SampleEntry, Split, write_index, write_sample
from vhquad.learn.pairs import is_second_of_pair
from vhquad.learn.samples import (
    PreprocessSettings,
    make_sample,
    operator_arrays,
    operator_settings,
    truth_arrays,
)
from vhquad.learn.sources import Part, read_source
from vhquad.learn.targets import leak

__all__ = ["PreprocessSettings", "preprocess"]

MESH_SUFFIXES = (".obj", ".ply", ".off", ".stl", ".glb")
REVISION = 3  # raise when samples made by older code are no longer good


@dataclass(frozen=True)
class _Job:
    folder: Path
    source: Path
    out: Path
    settings: PreprocessSettings
    chosen: dict[str, str]

    @property
    def name(self) -> str:
        return self.source.relative_to(self.folder).as_posix()

    @property
    def stem(self) -> str:
        return "-".join(self.source.relative_to(self.folder).with_suffix("").parts)

    @property
    def shape(self) -> str:
        return self.stem.split("__")[0]


@dataclass(frozen=True)
class _Done:
    source: str
    entries: tuple[SampleEntry, ...]
    skipped: tuple[tuple[str, str], ...]
    inputs: tuple[int, int] | None  # vectors and lines


def preprocess(
    folder: Path | str,
    out: Path | str,
    settings: PreprocessSettings | None = None,
    workers: int = 2,
    on_source: Callable[[str, int, int], None] | None = None,
) -> Dataset:
    """Prepare every mesh below a folder. Samples that are there already and still fit are kept.

    Parameters
    ----------
    folder : path
        Holds meshes (OBJ, PLY, OFF, STL, GLB), in subfolders too, and perhaps ``split.json``.
    out : path
        The dataset's folder; see :mod:`vhquad.learn.dataset` for its layout.
    settings : PreprocessSettings, optional
    workers : int
        Processes.
    on_source : callable, optional
        Called with (source, how many are done, how many there are) after each file.

    Returns
    -------
    Dataset

    Raises
    ------
    DatasetError
        If there is no mesh, or none could be used.
    """
    settings = PreprocessSettings() if settings is None else settings
    folder, out = Path(folder), Path(out)
    jobs = _jobs(folder, out, settings)
    (out / "samples").mkdir(parents=True, exist_ok=True)
    finished: dict[str, _Done] = {}
    for done in _run(jobs, workers):
        finished[done.source] = done
        if on_source is not None:
            on_source(done.source, len(finished), len(jobs))
    ordered = [finished[job.name] for job in jobs]
    entries = tuple(entry for done in ordered for entry in done.entries)
    skipped = tuple(item for done in ordered for item in done.skipped)
    if not entries:
        first = f"; the first: {skipped[0][0]}: {skipped[0][1]}" if skipped else ""
        raise DatasetError(f"none of the {len(jobs)} meshes in {folder} could be used{first}")
    channels, lines = next(done.inputs for done in ordered if done.inputs is not None)
    dataset = Dataset(
        folder=out,
        features=settings.features,
        turned=settings.turned,
        k=settings.k,
        in_channels=channels,
        in_lines=lines,
        order=4,
        samples=entries,
        skipped=skipped,
    )
    write_index(dataset)
    return dataset


def _jobs(folder: Path, out: Path, settings: PreprocessSettings) -> list[_Job]:
    if not folder.is_dir():
        raise DatasetError(f"{folder} is no folder")
    chosen: dict[str, str] = {}
    if (folder / "split.json").exists():
        try:
            chosen = json.loads((folder / "split.json").read_text(encoding="utf-8"))
        except ValueError as error:
            raise DatasetError(f"{folder / 'split.json'} is damaged: {error}") from None
        if not isinstance(chosen, dict) or set(chosen.values()) - {"train", "val", "test"}:
            raise DatasetError(
                f'{folder / "split.json"} must map shapes to "train", "val" or "test"'
            )
    sources = sorted(
        path
        for path in folder.rglob("*")
        if path.suffix.lower() in MESH_SUFFIXES
        and out not in path.parents
        and not is_second_of_pair(path)
    )
    if not sources:
        raise DatasetError(f"{folder} holds no mesh ({', '.join(MESH_SUFFIXES)})")
    return [_Job(folder, source, out, settings, chosen) for source in sources]


def _run(jobs: list[_Job], workers: int) -> Iterator[_Done]:
    seen: dict[str, str] = {}
    unique = []
    for job in jobs:
        if job.stem in seen:
            reason = f"another file of that name is used: {seen[job.stem]}"
            yield _Done(job.name, (), ((job.name, reason),), None)
        else:
            seen[job.stem] = job.name
            unique.append(job)
    if workers <= 1 or len(unique) == 1:
        yield from map(_prepare, unique)
        return
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker) as pool:
        futures = [pool.submit(_prepare, job) for job in unique]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            _stop(set(multiprocessing.active_children()) - others, unique[0].out)
            raise


def _start_worker() -> None:
    """One thread a process; Ctrl-C is the parent's business, which then stops the workers."""
    import torch

    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _stop(workers: set[multiprocessing.process.BaseProcess], out: Path) -> None:
    """End workers in the middle of their meshes, and remove what they had half written."""
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.join()
    for partial in (out / "samples").glob(".*.npz"):
        partial.unlink(missing_ok=True)


def _prepare(job: _Job) -> _Done:
    """All samples of one file."""
    entries: list[SampleEntry] = []
    skipped: list[tuple[str, str]] = []
    inputs = None
    try:
        parts = read_source(job.source)
    except (VhquadError, OSError) as error:
        return _Done(job.name, (), ((job.name, str(error)),), None)
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in parts[0].files)).hexdigest()
    for part in parts:
        count = job.settings.triangulations if part.quads is not None else 1
        for index in range(count):
            name = f"{job.stem}{part.suffix}.t{index}"
            try:
                entry, inputs = _sample(job, part, name, index, digest)
                entries.append(entry)
            except VhquadError as error:
                skipped.append((f"{job.name} ({name})", str(error)))
            except Exception as error:  # third-party code on strange input: name it and go on
                skipped.append((f"{job.name} ({name})", f"{type(error).__name__}: {error}"))
    return _Done(job.name, tuple(entries), tuple(skipped), inputs)


def _sample(
    job: _Job, part: Part, name: str, index: int, digest: str
) -> tuple[SampleEntry, tuple[int, int]]:
    """The entry of one sample, and how many vectors and lines it holds."""
    settings = job.settings
    relevant = {n: v for n, v in asdict(settings).items() if n not in ("val", "test")}
    if part.quads is not None:
        relevant.pop("triangulations")
    else:
        relevant = asdict(operator_settings(settings))
    text = json.dumps([REVISION, digest, name, relevant], sort_keys=True)
    key = hashlib.sha256(text.encode()).hexdigest()[:32]
    split = _split(job)
    kept = _kept(job.out / "samples" / f"{name}.npz", key)
    if kept is not None:
        return replace(kept[0], split=split), kept[1]
    made = make_sample(part, index, np.random.default_rng(int(key, 16)), settings)
    arrays = operator_arrays(made.mesh, settings, keep=made.field is None)
    if made.field is not None:
        arrays |= truth_arrays(made.field)
    entry = SampleEntry(
        name=name,
        shape=job.shape,
        source=job.name,
        split=split,
        truth=made.field is not None,
        vertices=made.mesh.n_vertices,
        leak=None if made.field is None else round(leak(made.mesh, made.field), 6),
        variant=made.variant,
        key=key,
    )
    arrays["entry"] = np.array(json.dumps(asdict(entry)))
    write_sample(job.out, name, arrays)
    return entry, (arrays["features"].shape[1], arrays["lines"].shape[1])


def _kept(path: Path, key: str) -> tuple[SampleEntry, tuple[int, int]] | None:
    """The entry, vectors and lines of a sample made earlier, if whole and of the same key."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            raw = json.loads(str(archive["entry"]))
            if raw["key"] != key:
                return None
            inputs = archive["features"].shape[1], archive["lines"].shape[1]
            return SampleEntry(**raw), inputs
    except Exception:  # missing or damaged in any way: make it again
        return None


def _split(job: _Job) -> Split:
    """By ``split.json``, else by the hash of the shape's name."""
    if job.shape in job.chosen:
        return job.chosen[job.shape]  # type: ignore[return-value]
    digest = hashlib.sha256(f"{job.settings.seed}/{job.shape}".encode()).digest()
    place = int.from_bytes(digest[:8], "big") / 2.0**64
    if place < job.settings.val:
        return "val"
    return "test" if place < job.settings.val + job.settings.test else "train"
