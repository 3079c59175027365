"""The picture of a run shows its states, modes and events, and refuses what is not a run."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import nonsmooth as ns

x, v = ca.SX.sym("x"), ca.SX.sym("v")
BLOCK = ns.FilippovSystem([x, v], surface=v, above=[v, -x - 0.4], below=[v, -x + 0.4])


@pytest.fixture(scope="module")
def run():
    return ns.simulate(BLOCK, [3.0, 0.0], t_end=15.0)


def test_conditions_that_hold_multipliers_are_no_lines_of_the_plane():
    i, e = ca.SX.sym("i"), ca.SX.sym("e")
    conducts = ns.Complementarity(v - x + 0.1 * i, multiplier=i)
    full = ns.Complementarity(0.5 - v, multiplier=e)
    system = ns.FilippovSystem([x, v], field=[-x, i - v - e], complementarity=[conducts, full])
    figure = ns.plot.trajectory(ns.simulate(system, [1.0, 0.0], t_end=3.0))
    (plane,) = [ax for ax in figure.axes if ax.get_xlabel() == "x"]
    (line,) = [line for line in plane.lines if line.get_gid() == "surface"]
    assert_allclose(line.get_ydata(), 0.5)


def panel(figure, label):
    return next(ax for ax in figure.axes if ax.get_ylabel() == label and ax.get_xlabel() != "x")


def test_curves_are_the_dense_output(run):
    figure = ns.plot.trajectory(run)
    for k, name in enumerate("xv"):
        curves = [line for line in panel(figure, name).lines if line.get_linestyle() != "None"]
        assert len(curves) == len(run.segments)
        for line in curves:
            t, values = line.get_data()
            assert_allclose(values, run(t)[:, k], atol=1e-12)


def test_events_are_marked_where_they_are(run):
    ax = panel(ns.plot.trajectory(run), "x")
    for kind in {event.kind for event in run.events}:
        marks = next(line for line in ax.lines if line.get_gid() == f"event {kind}")
        expected = [(event.t, event.x[0]) for event in run.events if event.kind == kind]
        assert_allclose(np.column_stack(marks.get_data()), expected)
        assert marks.get_marker() != "None"


def test_modes_differ_without_colour(run):
    lines = panel(ns.plot.trajectory(run), "x").lines[: len(run.segments)]
    looks = {
        segment.mode: (line.get_linestyle(), line.get_linewidth())
        for segment, line in zip(run.segments, lines, strict=True)
    }
    assert set(looks) == {"+", "-", "s"} and len(set(looks.values())) == 3


def test_the_strip_names_the_modes(run):
    strip = ns.plot.trajectory(run).axes[0]
    letters = [text.get_text().replace("−", "-") for text in strip.texts]
    assert letters == run.itinerary.split()


def test_a_planar_system_gets_its_phase_plane_with_the_surface(run):
    plane = ns.plot.trajectory(run).axes[-1]
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("x", "v")
    (surface,) = [line for line in plane.lines if line.get_gid() == "surface"]
    assert_allclose(surface.get_ydata(), 0.0, atol=1e-12)
    assert len(ns.plot.trajectory(run, phase_plane=False).axes) == 3


def test_states_can_be_chosen(run):
    figure = ns.plot.trajectory(run, states=["v"], phase_plane=False)
    assert [ax.get_ylabel() for ax in figure.axes[1:]] == ["v"]
    assert figure.axes[-1].get_xlabel() == "t"


def test_many_states_make_a_grid():
    states = [ca.SX.sym(f"q{k}") for k in range(9)]
    system = ns.FilippovSystem(states, surface=states[0], above=[-1.0] * 9, below=[1.0, *[0.5] * 8])
    run = ns.simulate(system, np.linspace(0.5, 1, 9), t_end=1.0)
    figure = ns.plot.trajectory(run)
    named = [ax for ax in figure.axes if ax.get_ylabel()]
    assert [ax.get_ylabel() for ax in named] == list(system.state_names)
    assert len({round(ax.get_position().x0, 3) for ax in named}) == 3


def test_resets_are_gaps_and_accumulation_is_marked():
    h, w = ca.SX.sym("h"), ca.SX.sym("w")
    ball = ns.FilippovSystem(
        [h, w], field=[w, -9.81], resets=[ns.Reset(h, [h, -0.5 * w], -1, "impact")]
    )
    run = ns.simulate(ball, [1.0, 0.0], t_end=10.0)
    assert run.status is ns.Status.ACCUMULATION
    ax = panel(ns.plot.trajectory(run), "w")
    count = sum(event.kind == "reset" for event in run.events)
    gaps = np.isnan(ax.lines[0].get_ydata()).sum()
    assert 0 < count - gaps <= 1  # the last one ends the run
    assert any(np.allclose(line.get_xdata(), run.accumulation_time) for line in ax.lines)


def test_several_surfaces_and_a_smooth_system_are_drawn():
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    relays = ns.FilippovSystem(
        [x, v], field=[-a + 2 * b, -2 * a - b], multipliers=[a, b], surfaces=[x, v]
    )
    figure = ns.plot.trajectory(ns.simulate(relays, [1.0, 0.5], t_end=0.7))
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "++" in legend and "+−" in legend
    smooth = ns.FilippovSystem([x, v], field=[v, -x])
    ns.plot.trajectory(ns.simulate(smooth, [1.0, 0.5], t_end=0.7)).savefig(
        "/dev/null", format="png"
    )


def test_backward_and_empty_runs_are_drawn():
    back = ns.flow.follow(BLOCK, [1.0, 0.5], -1.0, mode="+")
    ns.plot.trajectory(back)
    stuck = ns.simulate(ns.FilippovSystem([x], surface=x, above=[1], below=[-1]), [0.0], t_end=1.0)
    assert stuck.status is ns.Status.NON_UNIQUE
    ns.plot.trajectory(stuck)


def test_wrong_input_is_refused(run):
    with pytest.raises(ns.DefinitionError, match="Trajectory"):
        ns.plot.trajectory(BLOCK)
    with pytest.raises(ns.OptionError, match=r"states.*'y'"):
        ns.plot.trajectory(run, states=["y"])
    line = ns.FilippovSystem([x], surface=x, above=[-1], below=[1])
    with pytest.raises(ns.DefinitionError, match="phase_plane"):
        ns.plot.trajectory(ns.simulate(line, [1.0], t_end=0.5), phase_plane=True)


@pytest.mark.parametrize("name", ["cue_ball", "shaken_block"])
def test_motion_off_a_set_is_drawn_with_its_own_words(name):
    run = ns.textbook.by_name(name).run()
    figure = ns.plot.trajectory(run)
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    words += [
        t.get_text()
        for axes in figure.axes
        if axes.get_legend()
        for t in axes.get_legend().get_texts()
    ]
    assert any("off the set" in word for word in words)
    assert len(figure.axes) >= 2


@pytest.mark.slow
def test_a_run_of_very_many_events_marks_its_end_and_shortens_its_title():
    """A relay oscillator of some 340 crossings: what is drawn is the last event alone."""
    p, q = ca.SX.sym("p"), ca.SX.sym("q")
    system = ns.FilippovSystem([p, q], surface=p, above=[q, -1], below=[q, 1])
    run = ns.simulate(system, [0.0, 0.25], 170.0)
    assert len(run.events) > 300
    figure = ns.plot.trajectory(run)
    titles = [figure.get_suptitle(), *[ax.get_title() for ax in figure.axes]]
    (title,) = [t for t in titles if t.startswith("itinerary")]
    assert " …   status" in title
    marks = [
        line for ax in figure.axes for line in ax.lines if str(line.get_gid()).startswith("event")
    ]
    assert all(len(line.get_xdata()) == 1 for line in marks)


def test_impacts_are_gaps_and_every_event_has_a_mark():
    ball = ns.FilippovSystem([x, v], field=[v, -1.0], impacts=ns.Impact(x, restitution=0.5))
    run = ns.simulate(ball, [1.0, 0.0], t_end=6.0)
    figure = ns.plot.trajectory(run)
    times, speeds = panel(figure, "v").lines[0].get_data()
    impacts = [event.t for event in run.events if event.kind == "impact"][:10]
    assert_allclose(times[np.isnan(speeds)][:10], impacts)
    drawn = {str(line.get_gid())[6:] for line in panel(figure, "x").lines if line.get_gid()}
    assert drawn == {"impact", "contact", "end"}
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts == ["o", "c", "impact", "contact", "end", "start"]


def test_a_run_of_a_hybrid_automaton_shows_its_discrete_states():
    figure = ns.plot.trajectory(ns.textbook.gearbox().run())
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:3] == ["g=1", "g=2", "g=3"]
    colors = {line.get_color() for line in figure.axes[1].lines[:3]}
    assert len(colors) == 3
