"""Shows the measured and the simulated robot of an overlay in Rerun, above their joints and the differences.

    btr compare arm.toml log.csv -o overlay.mcap
    pip install rerun-sdk
    python3 rerun_overlay.py overlay.mcap                      # or, without a window: --save overlay.rrd
"""

import argparse

import rerun as rr
import rerun.blueprint as rrb

# Rerun reads the robots, their frames and their joints from the file; this only says what is shown, and where.
JOINTS = "joint_states/position"


def layout() -> rrb.Blueprint:
    """The robots on the left; positions and differences on the right, one above the other."""
    robots = rrb.Spatial3DView(
        name="measured (grey) and model (blue)",
        origin="/",
        contents=["+ /measured/**", "+ /model/**", "+ /tf/**", "+ /tf_static/**"],
        spatial_information=rrb.SpatialInformation(target_frame="world"),
    )
    positions = rrb.TimeSeriesView(
        name="position: command, measured and model",
        origin="/",
        contents=["+ /measured/joint_commands/position", f"+ /measured/{JOINTS}", f"+ /model/{JOINTS}"],
    )
    difference = rrb.TimeSeriesView(name="measured minus model", origin="/", contents=f"+ /difference/{JOINTS}")
    plots = rrb.Vertical(positions, difference)
    return rrb.Blueprint(rrb.Horizontal(robots, plots, column_shares=[3, 2]), collapse_panels=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("overlay", help="what `btr compare -o` has written (MCAP)")
    parser.add_argument("--save", metavar="RRD", help="write a recording instead of opening a window")
    arguments = parser.parse_args()
    rr.init("btr_overlay")
    if arguments.save:
        rr.save(arguments.save, default_blueprint=layout())
    else:
        rr.spawn(default_blueprint=layout())
    rr.log_file_from_path(arguments.overlay)


if __name__ == "__main__":
    main()
