# SPDX-License-Identifier: Apache-2.0
"""Results of recordings and their comparison; the coverage of the intervals by simulation."""

import h5py
import numpy as np
import pytest

import mjsense as mjs
from mjsense.commands import run as run_command
from mjsense.evaluation import compare, results
from mjsense.evaluation.intervals import episodes_needed, mcnemar, paired_difference, wilson

DRAWS = 10_000


def record(out, policy="planner", **options):
    mjs.record("pick", policy=policy, out=out, seed=5, num_attempts=4, keep_failures=True, width=32, horizon=57, action_noise=False,
               num_worlds=2, **options)  # fmt: skip
    return out


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    return record(folder / "a"), record(folder / "b", "top_down_planner")


def test_wilson_covers_the_truth():
    rng = np.random.default_rng(0)
    for n in (50, 200):
        truth = rng.random(DRAWS)
        low, high = wilson(rng.binomial(n, truth), n)
        assert 0.93 < ((low <= truth) & (truth <= high)).mean() < 0.97
    assert wilson(0, 20)[0] == 0 and wilson(20, 20)[1] == 1 and wilson(0, 0) == (0, 1)


def test_comparison_has_its_error_rate_and_coverage():
    rng, n = np.random.default_rng(1), 50
    for only_a, only_b in ((0.1, 0.1), (0.05, 0.2)):
        drawn, counts = np.unique(
            rng.multinomial(n, [only_a, only_b, 1 - only_a - only_b], DRAWS)[:, :2], axis=0, return_counts=True
        )
        if only_a == only_b:
            assert np.array([mcnemar(int(a), int(b)) <= 0.05 for a, b in drawn]) @ counts / DRAWS < 0.05
        intervals = np.array([paired_difference(int(a), int(b), n) for a, b in drawn])
        truth = only_b - only_a
        assert ((intervals[:, 0] <= truth) & (truth <= intervals[:, 1])) @ counts / DRAWS > 0.94
    assert mcnemar(0, 4) == 0.125 and mcnemar(3, 3) == 1 and episodes_needed(0.1, 0.2) == 155


def test_results(recordings, tmp_path):
    found = results(recordings[0])
    flags = [episode.success for episode in found.dataset.episodes]
    assert [row.success for row in found.rows] == flags and found.success.successes == sum(flags)
    for row, episode in zip(found.rows, found.dataset.episodes):
        first = np.flatnonzero(episode["success"])[:1]
        assert row.time_to_success_s == pytest.approx(first[0] / float(episode.fps)) if row.success else not row.time_to_success_s > 0
    assert found.to_table().num_rows == 4 and found.to_table()["seed"].to_pylist() == [5] * 4
    assert run_command(["results", str(recordings[0]), "--out", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"results.parquet", "report.html"}


def test_texts_are_escaped(tmp_path):
    record(tmp_path)
    for path in tmp_path.glob("house_0/*.h5"):
        with h5py.File(path, "r+") as file:
            for trajectory in file.values():
                trajectory.attrs["outcome"] = "<script>alert(1)</script>"
    page = results(tmp_path).to_html()
    assert "<script" not in page and "&lt;script&gt;" in page and "data:image/png" in page


def test_comparison(recordings, tmp_path, capsys):
    a, b = recordings
    found = compare(a, b)
    assert len(found.pairs) == 4 and found.difference == (found.only_b - found.only_a) / 4
    assert found.interval == compare(a, b).interval and found.interval[0] <= found.difference <= found.interval[1]
    assert run_command(["compare", str(a), str(b)]) == 0 and "McNemar" in capsys.readouterr().out
    other = record(tmp_path, perturb=0.5)
    with pytest.raises(ValueError, match=r"more than the policy: perturb is 0\.0 and 0\.5"):
        compare(a, other)
