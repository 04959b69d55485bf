"""What verbs bring back, in a recording: tables with units, diagrams that can be read, a screen for each kind."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from afm_msgs.msg import NamedArray
from recorded import Run
from viewed import chunks, column, events, panels, view

from afm_model.microscope.arrays import Arrays, Variable, variable
from afm_model.microscope.results import Calibration, TimeSeries
from afm_model.microscope.verbs.force_curve import Curve as ForceCurve
from afm_model.program.force_curve import APPROACH, RETRACT
from afm_node_common.decoding import InvalidMessage
from afm_node_common.verb_codec import named_arrays
from afm_recorder_node import checks, layout, result_views, screens
from afm_recorder_node.diagram import BLUE, HEIGHT, WIDTH, Axis, Diagram, DiagramLine, round_step
from afm_recorder_node.gathering import Gathering, Result
from afm_recorder_node.result_views import markdown

K, SENSITIVITY = 2.0, 1e-7
CONTACT, TURN, PULL = 60e-9, 100e-9, 5e-9


def curve(samples: int = 2000, *, triggered: bool = True) -> ForceCurve:
    """A stiff sample at z = 60 nm that lets go of the tip at a bend of 5 nm: 80 nN at the turn, 10 nN of pull."""
    z = np.concatenate([np.linspace(0.0, TURN, samples), np.linspace(TURN, 0.0, samples)])
    back = np.arange(2 * samples) >= samples
    bent = np.where(back, z - CONTACT > -PULL, z > CONTACT)
    channels = {
        "z": z,
        "deflection_voltage": np.where(bent, z - CONTACT, 0.0) / SENSITIVITY + 0.25,
        "lateral_voltage": np.zeros(len(z)),
        "phase": np.where(back, RETRACT, APPROACH).astype(np.float64),
    }
    units = {"z": "m", "deflection_voltage": "V", "lateral_voltage": "V", "phase": "1"}
    record = TimeSeries(1e-4 * np.arange(len(z)), channels, units)
    return ForceCurve(record, triggered, 3e-6, -1e-9, 1e-6, 1e-6, SENSITIVITY, K, 4.0)


def told(arrays: Arrays, verb: str = "ForceCurve", number: int = 1) -> list[NamedArray]:
    """An instrument's messages about a result."""
    about = {"verb": verb, "number": number, "arrays": len(arrays.variables) + len(arrays.coordinates)}
    more = {
        f"result.{name}": value for name, value in {**about, "time_ns": 2_000_000_000, "status": "complete"}.items()
    }
    more |= {f"about.{name}": value for name, value in arrays.attributes.items()}
    groups = (
        {name: each._replace(attributes={**each.attributes, **more}) for name, each in group.items()}
        for group in (arrays.variables, arrays.coordinates)
    )
    return named_arrays(Arrays(*groups))


def gathered(messages: list[NamedArray]) -> Iterator[Result]:
    gathering = Gathering()
    return filter(None, (gathering.put(checks.result_part(message)) for message in messages))


def tuned() -> Arrays:
    f = np.linspace(70e3, 80e3, 41)
    columns = {"amplitude": 1e-9 / (1.0 + ((f - 75e3) / 500.0) ** 2), "phase": np.arctan((f - 75e3) / 500.0)}
    columns["fitted_amplitude"] = columns["amplitude"]
    variables = {name: variable(("frequency",), values, name, "m") for name, values in columns.items()}
    told = {"verb": "Tune", "points": 41, "f0_Hz": 75e3, "f0_Hz_uncertainty": 2.0, "Q": 75.0, "Q_uncertainty": 0.5}
    return Arrays(variables, {"frequency": variable(("frequency",), f, "frequency", "Hz")}, told)


def test_force_curve_as_a_table_has_the_forces_that_it_was_made_with() -> None:
    (result,) = gathered(told(ForceCurve.together([curve(), curve(triggered=False)])))
    head, _, one, other = markdown(result).splitlines()[2:]
    cells = [cell.strip() for cell in one.strip("|").split("|")]
    assert [cell.strip() for cell in head.strip("|").split("|")] == [
        *("curve", "turned", "force there", "largest pull", "z in contact", "x, y")
    ]
    assert cells[:3] == ["1", "by its trigger", "80 nN"]
    assert float(cells[3].split()[0]) == pytest.approx(10.0, rel=0.01) and " nN ± " in cells[3]
    assert cells[4:] == ["40 nm", "3 µm, -1 nm"]
    assert "at the end of its way" in other


def test_force_curve_is_drawn_over_z_from_its_turn() -> None:
    (result,) = gathered(told(curve().arrays()))
    diagram = result_views.diagrams(result)[result_views.FORCE_CURVE]
    there, back = diagram.curves
    assert (there.name, back.name, diagram.x.unit, diagram.y.unit) == ("approach", "retract", "m", "N")
    assert (there.x.min(), there.x.max(), back.x.max()) == pytest.approx((-TURN, 0.0, 0.0))
    assert there.y[-1] - there.y[0] == pytest.approx(K * (TURN - CONTACT))
    assert back.y.min() - there.y[0] == pytest.approx(-K * PULL, rel=1e-2)


def test_numbers_of_a_calibration_have_their_units_and_uncertainties() -> None:
    found = Calibration(0.2075, 0.0113, "N/m", {"f0_Hz": 12_345.6, "Q": 81.0, "rms_m": 1.4e-10}).arrays()
    (result,) = gathered(told(found, "ThermalTune"))
    words = markdown(result)
    assert "| spring constant | 207.5 mN/m | 11 mN/m |" in words
    assert "| f0 | 12.35 kHz |  |" in words and "| rms | 140 pm |  |" in words and "| Q | 81 |  |" in words
    (result,) = gathered(told(tuned(), "Tune"))
    words = markdown(result)
    # What the verb was asked with is no result.
    assert "| f0 | 75 kHz | 2 Hz |" in words and "| Q | 75 | 0.5 |" in words and "points" not in words
    assert list(result_views.diagrams(result)) == [f"{layout.RESULT}/amplitude", f"{layout.RESULT}/phase"]


def test_diagram_has_round_numbers_at_its_axes_and_every_point_at_its_place() -> None:
    line = DiagramLine(np.array([0.0, 1e-6, np.nan]), np.array([-84e-9, 84e-9, 0.0]), "measured", BLUE)
    drawn = Diagram(Axis("z", "m"), Axis("force", "N"), [line]).draw()
    values = {name: {each.component_descriptor().component: each.as_arrow_array() for each in columns}
              for name, columns in drawn.items()}  # fmt: skip
    (strip,) = values["curves"]["LineStrips2D:strips"].to_pylist()[0]
    (left, low), (right, high) = strip
    # Upwards is less in a plane of the viewer; a twelfth of the height is free.
    assert 0.0 < left < right < WIDTH and 0.0 < high < low < HEIGHT
    labels = values["words"]["Points2D:labels"].to_pylist()[0]
    places = dict(zip(labels, values["words"]["Points2D:positions"].to_pylist()[0], strict=True))
    assert {"-50", "0", "50", "z [µm]", "force [nN]", "measured"} <= set(labels)
    # The numbers at an axis are where the curve has them.
    part = (places["-50"][1] - places["50"][1]) / (low - high)
    assert part == pytest.approx(100.0 / 168.0, rel=1e-6)
    assert (places["0.8"][0] - places["0.2"][0]) / (right - left) == pytest.approx(0.6, rel=1e-6)
    assert Diagram(Axis("z", "m"), Axis("force", "N"), []).draw() == {}
    # Of the unit that is shown: degrees of a phase in radians.
    turn = DiagramLine(np.array([0.0, 1.0]), np.array([-np.pi / 2, np.pi / 2]), "measured", BLUE)
    shown = {each.component_descriptor().component: each.as_arrow_array().to_pylist()
             for each in Diagram(Axis("f", "Hz"), Axis("phase", "rad"), [turn]).draw()["words"]}  # fmt: skip
    assert {"-50", "0", "50", "phase [°]"} <= set(shown["Points2D:labels"][0])


@pytest.mark.parametrize(("about", "step"), [(0.9, 1.0), (1.0, 1.0), (1.1, 2.0), (33.6e-9, 5e-8), (0.03, 0.05)])
def test_steps_of_an_axis_are_round(about: float, step: float) -> None:
    assert round_step(about) == pytest.approx(step)


@pytest.mark.parametrize(
    ("low", "high"), [(-84.0, 84.0), (-62.0, 70.0), (0.2, 9.1), (-3e-3, 1e-3), (12.0, 13.5), (-1, 99)]
)
def test_axis_of_a_plot_shows_two_numbers(low: float, high: float) -> None:
    found = screens.readable(low, high)
    begin, end = found or (low, high)
    assert begin <= low and end >= high
    # The viewer writes multiples of the least power of ten that are 22 points apart: of some 270 points, 12 at most.
    power = next(10.0**k for k in range(-6, 4) if (end - begin) / 10.0**k <= 12.3)
    assert np.floor(end / power) - np.ceil(begin / power) >= 1
    # Never more than twice as much.
    assert end - begin < 2.1 * (high - low) or (low, high) == (12.0, 13.5)


def test_axis_that_can_be_read_is_left_to_the_viewer() -> None:
    assert screens.readable(-135.0, 135.0) is None
    assert screens.readable(1.0, 1.0) is None
    assert screens.readable(np.nan, 1.0) is None


FORCES = [layout.RESULT, *(f"{result_views.FORCE_CURVE}/{name}" for name in ("grid", "curves", "words"))]


@pytest.mark.parametrize(
    ("entities", "kind", "tabs"),
    [
        (["/law/gain"], "control", None),
        (["/scan/height/trace", layout.RESULT], "scan", ["Scan", "Signals"]),
        (FORCES, "force curve", ["Force curve", "Signals"]),
        ([layout.RESULT], "calibration", ["Result", "Signals"]),
        ([layout.RESULT, f"{layout.RESULT}/amplitude/curves"], "calibration", ["Result", "Signals"]),
        (["/scan/height/trace", *FORCES], "scan", ["Scan", "Force curve", "Signals"]),
    ],
)
def test_each_kind_of_run_has_its_screen(entities: list[str], kind: str, tabs: list[str] | None) -> None:
    assert screens.kind(entities) == kind
    root = screens.blueprint(entities).root_container
    assert (root.name == "Signals") if tabs is None else [part.name for part in root.contents] == tabs
    if tabs:
        first = {view.origin for view in panels(root.contents[0])}
        assert {layout.RESULT, layout.EVENTS, layout.SCENE} <= first
        assert (result_views.FORCE_CURVE in first) == (kind == "force curve")


def test_view_of_a_result_shows_it(tmp_path: Path) -> None:
    messages = [*told(curve().arrays()), *told(tuned(), "Tune", 2)]
    path = view(tmp_path / "run.rrd", [*Run(100).messages(), *(("results", each) for each in messages)])
    assert len(column(path, layout.RESULT, "TextDocument:text")) == 2
    assert sum(chunk.num_rows for chunk in chunks(path, f"{result_views.FORCE_CURVE}/curves")) == 1
    odd = Arrays({name: Variable(("a",), np.zeros(k), {}) for k, name in enumerate(("z", "force", "phase"), 3)})
    path = view(tmp_path / "odd.rrd", (("results", each) for each in told(odd)))
    ((_, sentence),) = events(path)
    assert "1 messages are not shown" in sentence and "ForceCurve that cannot be drawn" in sentence


def test_result_whose_parts_did_not_all_come_is_given_up() -> None:
    first, second = told(curve().arrays(), number=1), told(curve().arrays(), number=2)
    (result,) = gathered([*first[:-1], *second])
    assert result.time_ns == 2_000_000_000


def test_arrays_that_are_no_result_are_refused_with_a_sentence() -> None:
    def refused(match: str, change: object) -> None:
        (message, *_) = told(curve().arrays())
        change(message)
        with pytest.raises(InvalidMessage, match=match):
            checks.result_part(message)

    def without(name: str) -> object:
        return lambda message: setattr(
            message, "attributes", [each for each in message.attributes if each.name != f"result.{name}"]
        )

    for name in ("verb", "number", "arrays", "time_ns", "status"):
        refused(f"result.{name} = None: it must be of type", without(name))
    refused("cannot reshape", lambda message: setattr(message, "shape", [7]))
    refused("is given twice", lambda message: message.attributes.append(message.attributes[0]))
    # A name in a message imports nothing.
    (result,) = gathered(told(Calibration(1.0, 0.1, "m", {"Q": 2.0}).arrays(), "Os/system"))
    assert "| Q | 2 |" in markdown(result)
