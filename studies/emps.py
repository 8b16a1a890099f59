#!/usr/bin/env python3
"""EMPS, a real drive with a ball screw: from a rigid carriage to the published figures, with btr's own verbs.

    cargo build --release
    BTR_DATA=FOLDER python3 studies/emps.py [--keep DIR]

The data set is "Data Set and Reference Models of EMPS" by A. Janot, M. Gautier and M. Brunot (Nonlinear System
Identification Benchmarks, 2019), as `episodes/estimation.csv` and `episodes/validation_pulses.csv` in `emps` of the
folder BTR_DATA (`../shared/data` next to this project). The pulses are held out.

Two models of the same machine, both initially without friction:

    robots/emps-force.toml   the carriage follows its measured motion; the required force is compared
    robots/emps.toml         the whole closed loop with its digital servo; the position is compared

For each, `btr diagnose` names the missing effects, `btr add` writes them into the model, `btr fit` fits it. Errors are
relative 2-norms, 100·|y - y_hat|/|y|. With the motion prescribed, both forces are smoothed by parabolas over 20 ms to
each side, as btr compares them (up to about 25 Hz; the wider the band, the larger the error); in the closed loop
nothing is smoothed.

In the file with pulses, the pulses are volts at the drive's input (the column says N); they are added to the reference
as the position that has the same effect. """

import csv
import math
import shutil

from asking import LOGS_OF_MACHINES, ROOT, ask, run

DATA = LOGS_OF_MACHINES / "emps"
KP_PER_S, KV_VS_PER_M = 160.18, 243.45
LOGS = ("estimation", "validation_pulses")


def convert(source, target):
    """A recorded episode with btr's names; m, N."""
    with source.open() as read, target.open("w", newline="") as write:
        rows = csv.writer(write)
        rows.writerow(["t", "cmd_slide", "q_slide", "tau_slide"])
        for row in csv.DictReader(read):
            pulse_m = float(row.get("pulse_N") or 0.0) / (KP_PER_S * KV_VS_PER_M)
            rows.writerow([row["t_s"], float(row["q_ref_m"]) + pulse_m, row["q_m"], row["force_N"]])


def relative(btr, model, log, channel):
    """100·|y - y_hat|/|y| of a channel, from the output of `btr compare`."""
    # Of all samples, as the published errors: also where the slide stands still.
    compared = ask(btr, "compare", str(model), str(log), "--set", "channels.keep_standstill=true")
    found = next(c for c in compared["channels"] if c["name"] == channel)
    with log.open() as file:
        values = [float(row[channel]) for row in csv.DictReader(file)]
    mean_square = (sum(values) / len(values)) ** 2
    spread = (found["rmse"] / (1.0 - found["fit_percent"] / 100.0)) ** 2
    return 100.0 * found["rmse"] / math.sqrt(spread + mean_square)


def improve(btr, name, folder, logs):
    """Diagnoses, adds and fits; returns the fitted model."""
    model, more, fitted = ROOT / "robots" / f"{name}.toml", folder / f"{name}-2.toml", folder / f"{name}-3.toml"
    estimation, pulses = logs
    found = ask(btr, "diagnose", str(model), str(estimation), "--held-out", str(pulses))
    names = [f"{e['effect']}@{e['site']}" for e in found["effects"]]
    print(f"\n{name}: {found['verdict']}, {', '.join(names) or 'nothing'} ({found['rollouts']} rollouts)")
    for step in found["error_ladder"]:
        print(f"  {step['step']:<40} {step['train']:8.2f} x noise floor, {step['held_out']:8.2f} held out")
    if not names:
        return model
    ask(btr, "add", str(model), *names, "-o", str(more))
    fit = ask(btr, "fit", str(more), str(estimation), "--held-out", str(pulses), "-o", str(fitted))
    for parameter in fit["parameters"]:
        print(f"  {parameter['name']:<46} {parameter['value']:12.5g} {parameter['unit']}")
    return fitted


def published_terms(btr, folder, logs):
    """The published model of the force: mass, Coulomb and viscous friction, each the same both ways, and an offset."""
    model, fitted = folder / "emps-terms.toml", folder / "emps-terms-2.toml"
    text = (ROOT / "robots" / "emps-force.toml").read_text()
    offset = '"formula.offset@slide" = { bounds = [-50, 50], value = 0.0 }'
    law = '[[effects]]\neffect = "formula"\nsite = "slide"\non = "torque"\nlaw = "-offset"\noffset = 0.0'
    model.write_text(f"{text}{offset}\n\n{law}\n")
    added = ["--add", "coulomb_friction@slide", "--add", "viscous_friction@slide"]
    fit = ask(btr, "fit", str(model), str(logs[0]), *added, "-o", str(fitted))
    print("\nthe published terms, motion prescribed")
    for parameter in fit["parameters"]:
        print(f"  {parameter['name']:<46} {parameter['value']:12.5g} {parameter['unit']}")
    return fitted


def study(btr, folder):
    logs = [folder / f"{name}.csv" for name in LOGS]
    # The improved models are written here and refer to it by a relative path.
    shutil.copy(ROOT / "robots" / "emps.urdf", folder)
    for name, log in zip(LOGS, logs):
        convert(DATA / "episodes" / f"{name}.csv", log)
    force = improve(btr, "emps-force", folder, logs)
    loop = improve(btr, "emps", folder, logs)
    terms = published_terms(btr, folder, logs)
    tau, q = "tau_slide", "q_slide"
    rows = [
        ("motion prescribed, published terms, force, fit", "4.083", relative(btr, terms, logs[0], tau)),
        ("motion prescribed, published terms, force, pulses", "5.982", relative(btr, terms, logs[1], tau)),
        ("motion prescribed, diagnosed, force, fit", "3.112", relative(btr, force, logs[0], tau)),
        ("motion prescribed, diagnosed, force, pulses", "-", relative(btr, force, logs[1], tau)),
        ("closed loop, position, fit", "0.0138", relative(btr, loop, logs[0], q)),
        ("closed loop, position, pulses", "-", relative(btr, loop, logs[1], q)),
        ("closed loop, force, fit", "5.85", relative(btr, loop, logs[0], tau)),
        ("closed loop, force, pulses", "8.94", relative(btr, loop, logs[1], tau)),
    ]
    print(f"\n{'relative error in %':<50} {'published':<26} reached")
    for what, published, reached in rows:
        print(f"{what:<50} {published:<26} {reached:.4g}")


if __name__ == "__main__":
    run(study, DATA, __doc__)
