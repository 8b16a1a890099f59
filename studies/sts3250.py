#!/usr/bin/env python3
"""A real servo at 50 samples a second: what does a model of a Feetech STS3250 lack, and what can four short logs
tell?

    cargo build --release && BTR_DATA=FOLDER python3 studies/sts3250.py [--keep runs/sts3250]

The logs are public ones of github.com/Rhoban/bam (Apache-2.0): `bam_xl330_pendulum` in the folder BTR_DATA, or
`../shared/data` next to this project. There are four, of 6 s each, at one position gain, with one weight and without
repetitions. `diagnose` learns from two (one of them lets the pendulum swing without torque) and confirms with a
third; `fit` learns from all three; the fourth, the fastest motion, is the test log. No errors are published with
them. The table is that of `servo_bench.py`. Takes about a minute on two cores. """

from pathlib import Path

from asking import run
from servo_bench import DATA, Servo, follow

ASKED, CONFIRMING, UNSEEN = ("sin_sin", "lift_and_drop"), ("up_and_down",), ("sin_time_square",)
MOST_EFFECTS = 6

# Data sheet, output shaft at 12 V: 50 kg·cm stalled, 60 degrees in 0.133 s without load. The position loop of the
# firmware as the logs' owners measured it on servos of this family: duty = 0.166·kp·error, with kp = 32. Weight and
# length are known and set the scale of all torques.
MODEL = """name = "sts3250_model"
seed = 1
[robot]
builtin = "pendulum"
mass_kg = 1.13
length_m = 0.12
[actuators."hinge"]
kind = "voltage"
kt = 1.52
resistance = 3.73
gain = 5.312
supply = 12.0
[simulation]
control_s = 0.002
steps_per_control = 1
[noise]
position_quantum_rad = 0.00153398
[channels]
time = "t_s"
torque_on = "torque_on"
channels = { cmd_hinge = "q_cmd_rad", q_hinge = "q_rad", dq_hinge = "dq_rad_s" }
[parameters]
"kt@hinge" = { bounds = [0.3, 5.0], scale = "log" }
"resistance@hinge" = { bounds = [0.5, 30.0], scale = "log" }
"armature.inertia@hinge" = { bounds = [0.0, 0.1] }
"""


def logs(motions: tuple[str, ...]) -> list[str]:
    return [str(DATA / "episodes" / f"sts3250_{motion}_kp32.csv") for motion in motions]


def study(btr: str, folder: Path) -> None:
    model = folder / "sts3250.toml"
    model.write_text(MODEL)
    follow(btr, Servo(str(model), logs(ASKED), logs(CONFIRMING), logs(UNSEEN), MOST_EFFECTS), folder)


if __name__ == "__main__":
    run(study, DATA, __doc__)
