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
