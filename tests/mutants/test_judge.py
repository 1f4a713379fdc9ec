"""The judge of the mutants finds what it is there for."""

import multiprocessing
import time

import numpy as np
import pytest

from tests.mutants.case_folder import Effect
from tests.mutants.judge import Judged, Verdict, broken_demands, judge
from tests.mutants.pipeline import Outcome
from tests.mutants.plan import mutants
from tests.mutants.pool import run_all

BASE = Outcome(
    "ok", flags={"CC": "force 20 N outside 49-186 N"}, marks={"CC": {"lesion": [100.0, 200.0]}}, scale_mm={"CC": 0.4}
)


def moved(**changes):
    return Outcome("ok", marks={"CC": {"lesion": [100.0, 220.0]}}, scale_mm={"CC": 0.4}, **changes)


def a_mutant(layer, error_mm=0.0, harmless=False):
    return Judged("kind", "name", "base", 0, harmless, Verdict(layer, error_mm))


def test_an_answer_elsewhere_is_measured_in_the_breast_and_stands_silent():
    verdict = judge(moved(), BASE, Effect())
    assert verdict.layer == "nothing"
    assert verdict.error_mm == pytest.approx(8.0)


def test_a_picture_moved_with_its_answer_is_the_same_answer():
    down = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 20.0]])
    assert judge(moved(), BASE, Effect({"CC": down})).error_mm == pytest.approx(0.0)


def test_places_of_a_volume_in_another_frame_are_compared_in_the_first():
    base = Outcome("ok", marks={"MR": {"lesion": [1.0, 2.0, 3.0]}})
    turned = Outcome("ok", marks={"MR": {"lesion": [-1.0, -2.0, 5.0]}})
    world = np.array([[-1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, 1.0, 0]])
    assert judge(turned, base, Effect(world=world)).error_mm == pytest.approx(2.0)


def test_an_answer_that_is_lost_without_a_word_is_wrong():
    assert judge(Outcome("ok"), BASE, Effect()).error_mm == np.inf
    unseen = Outcome("ok", flags={"CC lesion": "lies outside the imaged part"})
    assert judge(unseen, BASE, Effect()).silent


def test_a_new_flag_catches_and_an_old_or_usual_one_does_not():
    assert judge(moved(flags={"CC": "outline misfit 7.0 mm"}), BASE, Effect()).layer == "trust"
    known = Outcome("ok", flags={"CC": "outline misfit 6.0 mm"}, marks=BASE.marks, scale_mm=BASE.scale_mm)
    assert judge(moved(flags={"CC": "outline misfit 7.0 mm"}), known, Effect()).layer == "nothing"
    assert judge(moved(flags={"CC": "force 250 N outside 49-186 N"}), BASE, Effect()).layer == "nothing"


def test_a_flag_on_a_landmark_says_nothing_of_a_lesion():
    stray = moved(flags={"CC P01": "marked in the air"})
    assert judge(stray, BASE, Effect()).silent
    assert not judge(stray, BASE, Effect(), landmarks=True).silent


def test_a_bug_is_a_traceback_and_a_fault_is_not():
    assert judge(Outcome("bug", "stopped by a bug"), BASE, Effect()).broken
    assert judge(Outcome("traceback", "KeyError"), BASE, Effect()).broken
    assert judge(Outcome("check", "no such file"), BASE, Effect()).layer == "check"


def test_each_demand_can_be_broken():
    good = [a_mutant("check")] * 97
    assert broken_demands(good) == []
    assert len(broken_demands([*good, a_mutant("traceback")])) == 1
    assert len(broken_demands([*good, a_mutant("hang")])) == 1
    assert len(broken_demands([*good, a_mutant("nothing", 5.1)])) == 1
    assert broken_demands([*good, a_mutant("nothing", 4.9)]) == []
    assert len(broken_demands([*good, *[a_mutant("nothing", 1.1)] * 3])) == 1
    harmless = [a_mutant("nothing", harmless=True)] * 19
    assert broken_demands([*harmless, a_mutant("check", harmless=True)]) == []
    assert len(broken_demands([*harmless, *[a_mutant("trust", harmless=True)] * 2])) == 1


def test_a_job_that_hangs_or_crashes_is_told_from_one_that_ends():
    def work(job):
        if job == "hangs":
            time.sleep(60.0)
        if job == "crashes":
            multiprocessing.current_process().kill()

    jobs = ["ends", "hangs", "crashes"]
    assert dict(run_all(jobs, work, 2, 1.0)) == {0: "done", 1: "hang", 2: "crash"}


def test_the_mutants_are_many_and_the_same_each_time():
    names = [mutant.name for mutant in mutants(["nifti", "dicom", "pictures", "both"])]
    assert len(set(names)) == len(names) > 500
    one = mutants(["nifti"])[0]
    assert one.random().random() == mutants(["nifti"])[0].random().random()
