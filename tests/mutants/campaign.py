"""Runs mutants: the unmutated cases first, then each mutant in a process of its own, and the verdicts."""

import json
import shutil
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.mutants.case_folder import CaseFolder, DoesNotApplyError, Effect
from tests.mutants.judge import Judged, judge
from tests.mutants.pipeline import Memory, Outcome, read_memory, run_case, write_memory
from tests.mutants.plan import Mutant
from tests.mutants.pool import run_all

TIMEOUT_S = 240.0
"""A mutant that takes longer counts as a hang; the longest take a tenth of it on an idle core."""
Makers = Mapping[str, Callable[[Path], CaseFolder]]


@dataclass(frozen=True)
class Campaign:
    """Mutants in a folder.

    Attributes:
        folder: for everything that is written.
        makers: of the unmutated cases, by name.
        processes: at the same time.
    """

    folder: Path
    makers: Makers
    processes: int

    def run(self, mutants: Sequence[Mutant]) -> tuple[list[Judged], dict[str, Outcome]]:
        """Verdicts on the mutants, in their order, and the outcomes of the unmutated cases."""
        names = list(dict.fromkeys(mutant.base for mutant in mutants))
        for name in names:
            if not (self._base(name) / "case").exists():
                self.makers[name](self._base(name) / "case")
        for number, ended in run_all(names, self._run_base, self.processes, 3 * TIMEOUT_S):
            if ended != "done":
                raise RuntimeError(f"the unmutated case {names[number]} ended as {ended}")
        bases = {name: Outcome.read(self._base(name) / "outcome.json") for name in names}
        ends = dict(run_all(mutants, self._run_mutant, self.processes, TIMEOUT_S))
        judged = [self._judged(mutant, ends[number], bases) for number, mutant in enumerate(mutants)]
        return [one for one in judged if one is not None], bases

    def _base(self, name: str) -> Path:
        return self.folder / "unmutated" / name

    def _run_base(self, name: str) -> None:
        base, memory = self._base(name), Memory()
        case = CaseFolder.read(base / "case")
        run_case(case.tables, base / "results", memory).write(base / "outcome.json")
        write_memory(base / "memory.json", memory)

    def _place(self, mutant: Mutant) -> Path:
        return self.folder / "mutants" / f"{mutant.base}_{zlib.crc32(mutant.name.encode())}"

    def _run_mutant(self, mutant: Mutant) -> None:
        place = self._place(mutant)
        place.mkdir(parents=True)
        case = CaseFolder.copied(self._base(mutant.base) / "case", place / "case")
        try:
            effect = mutant.mutation.change(case, mutant.random()) or Effect()
        except DoesNotApplyError:
            return
        case.write_tables()
        (place / "effect.json").write_text(json.dumps(_plain(effect)))
        memory = read_memory(self._base(mutant.base) / "memory.json")
        run_case(case.tables, place / "results", memory).write(place / "outcome.json")
        for bulky in ("case", "results"):
            shutil.rmtree(place / bulky, ignore_errors=True)

    def _judged(self, mutant: Mutant, ended: str, bases: Mapping[str, Outcome]) -> Judged | None:
        """None where the case has nothing to mutate."""
        place, mutation = self._place(mutant), mutant.mutation
        if not (place / "effect.json").exists():
            if ended == "done":
                return None
            raise RuntimeError(f"the mutation {mutant.name} itself ended as {ended}")
        written = place / "outcome.json"
        outcome = Outcome.read(written) if ended == "done" else Outcome("hang" if ended == "hang" else "bug", ended)
        effect = _effect(json.loads((place / "effect.json").read_text()))
        verdict = judge(outcome, bases[mutant.base], effect, mutation.landmarks)
        return Judged(
            mutation.kind,
            mutation.name,
            mutant.base,
            mutant.number,
            mutation.harmless,
            verdict,
            effect.note,
            outcome.seconds,
        )


def _plain(effect: Effect) -> dict[str, object]:
    pixels = {view: np.asarray(to).tolist() for view, to in effect.pixels.items()}
    return {"pixels": pixels, "world": np.asarray(effect.world).tolist(), "note": effect.note}


def _effect(values: dict) -> Effect:
    pixels = {view: np.array(to) for view, to in values["pixels"].items()}
    return Effect(pixels, np.array(values["world"]), values["note"])
