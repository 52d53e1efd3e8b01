"""What distinguishes the members of the family."""

from __future__ import annotations

from tests.support.minds import Mind
from tests.support.plain import plain

family, settings, tracking = (plain("ddcs.family"), plain("ddcs.settings"), plain("ddcs.tracking.motion"))
PURSUIT = {"pngl-l-phi", "pngl", "deviated-pursuit", "velocity-pursuit", "ddcs-centralized-pursuit"}
CENTRALIZED = {
    "pngl-l-phi",
    "ddcs-centralized-pursuit",
    "ddcs-centralized",
    "ddcs-centralized-l-l",
    "ddcs-centralized-no-exchange",
}


def test_pursuers_follow_a_circle_and_have_the_constants_of_the_paper() -> None:
    for name, s in family.FAMILY.items():
        assert (s.guidance == "pngl") == (name in PURSUIT)
        assert s.turn_share == (1.0 if name in PURSUIT else 0.0)
        assert (s.model == "centralized") == (name in CENTRALIZED)
        assert (s.follower_frame == "slot-frame") == (name in CENTRALIZED)
        assert s.radio == (name != "ddcs-no-radio")
        record = settings.settings_record(s)[0]
        constants = [tracking.own_constant(record, own, 5) for own in (0, 2, 4)]
        wanted = {"pngl": [0.9, 1.0, 1.1], "pngl-l-phi": [1.1, 1.1, 1.1]}
        assert [round(k, 9) for k in constants] == wanted.get(name, [1.0, 1.0, 1.0])


def test_a_record_holds_choices_by_their_place_and_numbers_as_they_are() -> None:
    assert settings.settings_record(settings.Settings()).shape == (1,)
    m = Mind(
        played={
            "model": "centralized",
            "deviation": "occupant",
            "gain": 2.25,
            "radio": False,
            "forbidden": ("searching>flocking", "exchange>converging", "exchange>converging"),
        }
    )
    s = m.s
    assert (s.model, s.guidance, s.deviation, s.follower_law, s.radio) == (1, 0, 2, 0, 0)
    assert (s.gain, s.near) == (2.25, 1.0)
    assert s.forbidden == 1 << 2 | 1 << 13
    assert s.forbidden.dtype.kind == "i"
    assert s.gain.dtype.kind == "f"
