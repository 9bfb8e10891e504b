"""MuJoCo as a referee of the crane's mechanics: the same crane as a tree of 12 joints.

A crane that slews, luffs and hoists on a ship in six degrees of freedom swings its load for a
minute. MuJoCo gives the equations of motion of the tree (three slides, yaw, pitch and roll of the
ship, slew, luff, a ball joint, a slide for the rope); all but the ball are led along, and SciPy's
DOP853 integrates what is left. The package takes the tip's path alone. Needs `mujoco`, which the
package does not.

    .venv/bin/python examples/crane_mujoco.py
"""

# %%
from math import cos, degrees, radians, sin

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

from swashplate.crane import Crane, kinematics, load_motion

# %%
SECONDS, RATE, START = 60.0, 512.0, 0.5  # the last one: swing at the start [rad]
WAVES = {  # mean, amplitude, frequency [rad/s], phase; [m], [rad]
    "surge": (0.0, 0.3, 0.5, 0.0),
    "sway": (0.0, 0.4, 0.62, 0.3),
    "heave": (0.0, 0.5, 0.7, 1.0),
    "yaw": (0.0, radians(0.5), 0.4, 0.0),
    "pitch": (0.0, radians(1.0), 0.75, 0.5),
    "roll": (0.0, radians(2.0), 0.6, 0.0),
    "slew": (-0.8, 0.8, 0.35, 0.0),
    "boom": (radians(45.0), radians(8.0), 0.27, 0.0),
    "rope": (20.0, -4.0, 0.2, 0.0),
}
TREE = """
<mujoco><option gravity="0 0 -9.80665"/><worldbody>
<body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 0 1"/>
<joint type="hinge" axis="0 1 0"/><joint type="hinge" axis="1 0 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body pos="{axis}"><joint type="hinge" axis="0 0 -1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body pos="{foot} 0 0"><joint type="hinge" axis="0 -1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body pos="{boom} 0 0"><joint type="ball"/>
<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-6 1e-6 1e-6"/>
<body><joint type="slide" axis="0 0 -1"/>
<inertial pos="0 0 0" mass="1e4" diaginertia="1e-3 1e-3 1e-3"/>
</body></body></body></body></body></worldbody></mujoco>
"""
LED = [*range(8), 11]  # velocities that are given; 8 to 10 are the ball's


# %%
def led(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, speeds and accelerations of the joints that are led."""
    mean, size, omega, phase = np.array([*WAVES.values()]).T
    turn = omega * t + phase
    place = mean + size * np.sin(turn)
    return place, size * omega * np.cos(turn), -size * omega**2 * np.sin(turn)


# %%
def referee(crane: Crane, time: np.ndarray) -> np.ndarray:
    """Path of the load by MuJoCo's equations, (n, 3). [m]"""
    g = crane.geometry
    text = TREE.format(axis=f"{g.axis.x} {g.axis.y} {g.axis.z}", foot=g.foot, boom=g.boom)
    model = mujoco.MjModel.from_xml_string(text)
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))

    def put(t: float, ball: np.ndarray) -> np.ndarray:
        place, speed, acceleration = led(t)
        data.qpos[:8], data.qpos[8:12], data.qpos[12] = place[:8], ball[:4], place[8]
        data.qpos[8:12] /= np.linalg.norm(ball[:4])
        data.qvel[LED], data.qvel[8:11] = speed, ball[4:]
        return acceleration

    def rates(t: float, ball: np.ndarray) -> np.ndarray:
        acceleration = put(t, ball)
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        free = slice(8, 11)
        right = -data.qfrc_bias[free] - mass[free][:, LED] @ acceleration
        w, x, y, z = ball[:4]
        a, b, c = ball[4:]
        turn = 0.5 * np.array(
            [
                -x * a - y * b - z * c,
                w * a + y * c - z * b,
                w * b + z * a - x * c,
                w * c + x * b - y * a,
            ]
        )
        return np.concatenate([turn, np.linalg.solve(mass[free, free], right)])

    # the rope starts in the plane of x and z, and turns with nothing but the tip
    put(0.0, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    mujoco.mj_kinematics(model, data)
    upper = data.xmat[4].reshape(3, 3)
    wanted = np.array(
        [[cos(START), 0.0, -sin(START)], [0.0, 1.0, 0.0], [sin(START), 0.0, cos(START)]]
    )
    quaternion, spin = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quaternion, (upper.T @ wanted).ravel())
    put(0.0, np.concatenate([quaternion, spin]))
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, None, jacobian, 4)
    spin = np.linalg.solve(jacobian[:, 8:11], -(jacobian[:, LED[:8]] @ data.qvel[LED[:8]]))
    made = solve_ivp(
        rates,
        (0.0, time[-1]),
        np.concatenate([quaternion, spin]),
        "DOP853",
        time,
        rtol=1e-10,
        atol=1e-10,
    )
    path = np.empty((time.size, 3))
    for n, t in enumerate(time):
        put(float(t), made.y[:, n])
        mujoco.mj_kinematics(model, data)
        path[n] = data.xpos[5]
    return path


# %%
def tip_at(crane: Crane, t: float) -> np.ndarray:
    """Tip of the boom. [m]"""
    surge, sway, heave, yaw, pitch, roll, slew, boom, _ = led(t)[0].tolist()
    tip = kinematics.tip_of(slew, kinematics.Boom(cos(boom), sin(boom)), crane.geometry)
    rotation = kinematics.rotation(roll, pitch, yaw)
    shift = kinematics.Vector(surge, sway, heave)
    return np.array(kinematics.to_inertial(rotation, tip, shift))


# %%
def main() -> None:
    """Print how far both loads are apart."""
    crane = Crane.preset("tg3637")
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    tip = np.array([tip_at(crane, t) for t in time])
    rope = np.array([led(t)[0][8] for t in time])
    down = np.array([sin(START), 0.0, -cos(START)])
    speed = (tip_at(crane, 1e-5) - tip_at(crane, -1e-5)) / 2e-5
    start, v = tip[0] + rope[0] * down, speed + led(0.0)[1][8] * down
    every = slice(None, None, 64)
    other = referee(crane, time[every])
    swing = 0.0
    for rate in (512, 1024, 2048):
        fine = np.arange(round(SECONDS * rate) + 1) / rate
        path = np.array([tip_at(crane, t) for t in fine])
        length = np.array([led(t)[0][8] for t in fine])
        load = load_motion(path, length, rate, start=start, velocity=v).position
        apart = np.linalg.norm(load[:: rate // 8] - other, axis=1)
        swing = max(swing, degrees(np.arccos(np.min((path - load)[:, 2] / length))))
        print(
            f"{rate:4d} Hz: at most {1e3 * apart.max():.4f} mm, {1e3 * apart[-1]:.4f} mm at the end"
        )
    print(f"swing up to {swing:.0f} deg in {SECONDS:g} s")


# %%
if __name__ == "__main__":
    main()
