"""Files damaged, altered and mistaken in hundreds of ways: each ends in a message, a flag, or the same answer."""

import os
from pathlib import Path

import pytest

from tests.mutants.account import write_account
from tests.mutants.bases import BASES, QUICK, available
from tests.mutants.campaign import Campaign
from tests.mutants.judge import broken_demands
from tests.mutants.plan import mutants, quick_share

LEAST = 400
ACCOUNT = Path(__file__).resolve().parents[2] / "results" / "mutants"


def test_a_share_of_the_mutants_ends_as_all_shall(tmp_path):
    chosen = quick_share(mutants(QUICK))
    found, bases = Campaign(tmp_path, QUICK, 1).run(chosen)
    assert all(outcome.ended == "ok" for outcome in bases.values())
    assert len(found) > 20, [m.seconds for m in found]
    assert broken_demands(found) == []


@pytest.mark.slow
def test_all_mutants_end_in_a_message_a_flag_or_the_same_answer(tmp_path):
    processes = len(os.sched_getaffinity(0))
    found, bases = Campaign(tmp_path, BASES, processes).run(mutants(available()))
    print(write_account(ACCOUNT, found, bases))
    assert sum(not one.harmless for one in found) >= LEAST
    assert broken_demands(found, bases.values()) == []
