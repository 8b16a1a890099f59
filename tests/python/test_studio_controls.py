"""The studio's sliders, buttons and notices."""

import queue
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

pytest.importorskip("viser", reason="the studio needs viser")

import btr
from btr._studio.candidates import plain
from btr._studio.cause import Candidates
from btr._studio.frozen import StandIns
from btr._studio.notices import Notices
from btr._studio.server import Server
from btr._studio.session import Session
from btr._studio.sliders import Sliders, on_grid, reach, step_of
from studio_served import served
from studio_sessions import ROBOTS

__all__ = ["served"]


def test_a_slider_of_a_tiny_value_is_fine_enough() -> None:
    known = {"name": "x", "unit": "1", "min": 0.0, "max": 11.0, "scale": "linear", "nominal": 0.0}
    dim = btr.documents.Dimension(known)
    assert reach(dim, 0.25) == (0.0, 1.0)
    assert reach(dim, 5.0) == (0.0, 11.0) == reach(dim, 0.0)


def test_sliders_have_fine_steps_and_show_them(served: tuple[Server, str]) -> None:
    for low, high in ((0.0, 1.0), (0.0, 6.2), (17.0, 23.6), (1e-6, 3e-5), (0.0, 9999.0)):
        assert 1000 <= (high - low) / step_of(low, high) <= 20_001
    assert on_grid(19.618092, 25.931961, 0.001) == (19.619, 25.931) and on_grid(0.0, 0.3, 0.0001) == (0.0, 0.3)
    model = btr.load_model(ROBOTS / "arm.toml").add("coulomb_friction@yaw")
    session = Session(model.at({"coulomb_friction.torque@yaw": 0.25764, "kp@yaw": 18.9926}), ROBOTS / "arm/learn_1.csv")
    sliders = Sliders(served[0], lambda *_: None, print)
    sliders.load(session)
    shown = {name: slider.value for name, slider in sliders.sliders.items()}
    assert shown["coulomb_friction.torque@yaw"] == 0.2576 and shown["kp@yaw"] == 18.993
    # A value's own digits would be shown after what is typed, as zeros.
    assert sliders.sliders["coulomb_friction.torque@yaw"].precision == 4 and sliders.sliders["kp@yaw"].precision == 3


def test_a_value_typed_beyond_its_bounds_is_told_once_typing_ends(
    served: tuple[Server, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("btr._studio.sliders.TYPED_S", 0.05)
    told: queue.Queue[str] = queue.Queue()
    values: list[float] = []
    sliders = Sliders(served[0], lambda _, value: values.append(value), told.put)
    sliders.load(Session(ROBOTS / "arm.toml", ROBOTS / "arm/learn_1.csv"))
    slider = sliders.sliders["kp@yaw"]
    (moved,) = slider._impl.update_cb

    def typed(*numbers: float) -> None:
        for number in numbers:
            slider._impl.value = number
            moved(SimpleNamespace(client=object()))

    typed(9.0, 99.0, slider.max)
    assert told.get(timeout=5.0) == "kp@yaw: 99 is beyond its bounds, 17 to 23.6 N·m/rad. It is set to 23.6."
    assert values == pytest.approx([17.0, slider.max, slider.max]) and slider.value == pytest.approx(23.6)
    typed(1.0, 18.0, 18.5)
    with pytest.raises(queue.Empty):
        told.get(timeout=0.3)
    assert values[-1] == 18.5


def test_one_notice_is_shown_at_a_time() -> None:
    client, server = MagicMock(), MagicMock()
    client.add_notification.side_effect = lambda *_, **__: MagicMock()
    server.get_clients.return_value = {0: client}
    notices = Notices(server)
    notices.running("fitting, 1 s")
    notices.running("fitting, 2 s")
    (running,) = notices._shown
    assert client.add_notification.call_count == 1 and running.body == "fitting, 2 s"
    notices.done("Fitted")
    running.remove.assert_called_once()
    assert client.add_notification.call_args.args[1] == "Fitted"
    notices.running("saving, 1 s")
    assert client.add_notification.call_count == 3


def test_all_that_is_established_can_be_added_at_once() -> None:
    server, added = MagicMock(), []
    server.gui.add_button.side_effect = lambda label, **_: MagicMock(label=label)
    cards = Candidates(server, added.extend, added.clear, added.extend)
    friction, creep, other = (plain(f"{effect}@yaw") for effect in ("coulomb_friction", "friction_creep", "backlash"))
    found = [replace(friction, established=True), replace(creep, established=True), other]
    session = SimpleNamespace(step=SimpleNamespace(added=()), previewed=None, candidates=found, added=[])
    cards.load(session)
    first = cards.buttons[0]
    assert first.label == "Add all 2"
    (act,) = first.on_click.call_args.args
    act(None)
    assert added == ["coulomb_friction@yaw", "friction_creep@yaw"]
    session.candidates = [found[0], other]
    cards.load(session)
    assert all("Add all" not in button.label for button in cards.buttons)


def test_what_stands_in_for_an_effect_can_be_frozen_until_it_is() -> None:
    server, asked = MagicMock(), []
    server.gui.add_button.side_effect = lambda label, **_: MagicMock(label=label)
    stand_ins = StandIns(server, lambda name, value: asked.append((name, value)))
    taken = [SimpleNamespace(parameter=name, in_model=0.2) for name in ("kd@hinge", "friction.torque@hinge")]
    step, found = SimpleNamespace(frozen=()), SimpleNamespace(stand_ins=taken)
    session = SimpleNamespace(step=step, diagnosis=found, is_diagnosed=False, freezable=["kd@hinge"])
    stand_ins.load(session)
    (button,) = stand_ins.buttons
    assert button.label == "Freeze kd@hinge at 0.2"
    (act,) = button.on_click.call_args.args
    act(None)
    assert asked == [("kd@hinge", 0.2)], "the value that the diagnosed model states"
    session.step = SimpleNamespace(frozen=("kd@hinge",))
    stand_ins.load(session)
    assert stand_ins.buttons == []
