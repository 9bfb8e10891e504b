"""The crane's examples on packages that are not the project's own, where these are installed."""

import re

import pytest


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")  # the observations have no bounds
def test_gymnasium_environment_is_one_and_feedback_earns_more(run_example):
    pytest.importorskip("gymnasium", reason="the example needs gymnasium")
    from gymnasium.utils.env_checker import check_env

    made = run_example("crane_gymnasium")
    without, fed = (float(each) for each in re.findall(r"return (-[\d.]+)", made.printed))
    assert fed > without
    check_env(made.names["CraneEnv"](), skip_render_check=True)


@pytest.mark.slow
def test_mujocos_equations_lead_the_load_along_the_same_path(run_example):
    pytest.importorskip("mujoco", reason="the example needs mujoco")
    made = run_example("crane_mujoco")
    apart = [float(each) for each in re.findall(r"at most ([\d.]+) mm", made.printed)]
    assert apart[0] < 0.3
    # second order: a quarter of the distance at twice the rate
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.05)


@pytest.mark.slow
def test_predictive_control_swings_least_and_within_its_step(run_example):
    pytest.importorskip("osqp", reason="the example needs osqp")
    printed = run_example("crane_mpc", "--seeds", "1", "--length", "80").printed
    swing = {
        name: [float(each) for each in re.findall(rf"{name} +([\d.]+) deg", printed)]
        for name in ("shaper", "clip", "predictive")
    }
    # in the rougher sea, where the drives cannot follow
    assert swing["predictive"][1] < min(swing["clip"][1], swing["shaper"][1])
    taken = [float(each) for each in re.findall(r"takes ([\d.]+) ms", printed)]
    assert max(taken) < 1000.0 * 100 / 512  # a step lasts 100 samples
