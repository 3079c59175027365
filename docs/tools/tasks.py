"""The API by task: which page describes which name, and what the page says first.

A public name that is on no page fails `tests/docs/test_site.py`: add it here, where a reader who has the
task would look for it. Pages come in the order of the navigation of mkdocs.yml.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Task:
    """A page of the API: its title, first paragraph, package, and names in their order on the page."""

    title: str
    about: str
    package: str
    names: tuple[str, ...]


def _task(title: str, about: str, package: str, names: str) -> Task:
    return Task(title, about, package, tuple(names.split()))


#: Pages that are written by hand-made lists of names; the file is `api/<key>.md`.
TASKS = {
    "systems": _task(
        "Write a system",
        "A system is a list of states, a smooth field on each side of its switching surfaces, and what "
        "else happens to the state: stops, jumps, impacts, clocks. "
        "[Surfaces and sliding](../theory.md) explains the words.",
        "nonsmooth",
        "FilippovSystem table model.Switching Friction Relay Complementarity Stop Reset Impact Constraint Clock regularise call",
    ),
    "runs": _task(
        "Follow an orbit",
        "From a point and for a time: events, modes, dense output, and the reason why a run ended.",
        "nonsmooth",
        "simulate explore Trajectory flow.Segments flow.Segment flow.Events flow.Event Status Section flow.follow flow.first_crossing flow.first_root load",
    ),
    "many": _task(
        "Run many starts",
        "Arrays of starts or of parameters, in threads, on a cluster, in a store on disk; and which "
        "attractor each start goes to.",
        "nonsmooth",
        "ensemble Ensemble Grid RandomStarts Work outcomes flow.Outcomes basins attractors orbit.Basins orbit.Attractor",
    ),
    "points": _task(
        "Ask what a point is",
        "What the fields do at a point of a surface, and what is special about it. Nothing here "
        "steps in time.",
        "nonsmooth",
        "classify region Region alpha sliding_field local.sliding_branches local.fold local.fold_fold local.two_fold "
        "local.boundary_equilibrium local.intersection local.intersection_range local.limit_directions",
    ),
    "search": _task(
        "Find special points",
        "Folds, two-folds, equilibria and pseudo-equilibria near a guess, or all that can be found "
        "from many guesses. That a list is complete is proven on another page, [Prove](proofs.md).",
        "nonsmooth",
        "find_two_fold local.TwoFold find_fold find_equilibrium find_pseudo_equilibrium "
        "find_boundary_equilibrium find_all orbit.trace_two_folds",
    ),
    "orbits": _task(
        "Find periodic orbits",
        "An orbit that closes, stable or not, with its itinerary, its period and its multipliers; "
        "the successive returns of any orbit to a section; how kicks shift the phase of an orbit, and whether "
        "coupled oscillators stay in step.",
        "nonsmooth",
        "periodic_orbit orbit.PeriodicOrbit orbit.poincare orbit.PoincareOrbit orbit.FixedItinerary "
        "phase_response orbit.PhaseResponse master_stability orbit.MasterStability",
    ),
    "derivatives": _task(
        "Differentiate a run",
        "How the end of a run changes with its start and its parameters, through crossings, sliding "
        "and jumps; and the mean rates of that over a long time.",
        "nonsmooth",
        "sensitivity orbit.Sensitivity gradient orbit.Gradient vjp orbit.saltation_matrix lyapunov_spectrum "
        "orbit.LyapunovSpectrum",
    ),
    "interop": _task(
        "JAX, PyTorch, SymPy",
        "Runs as functions that JAX and PyTorch differentiate, and systems from SymPy's equations. Each needs its library, "
        "by the extras `jax`, `torch` and `sympy`.",
        "nonsmooth",
        "interop.jax.simulate interop.jax.ensemble interop.torch.simulate interop.torch.ensemble "
        "interop.sympy.system interop.sympy.expression",
    ),
    "branches": _task(
        "Vary a parameter",
        "Orbits and equilibria followed as a parameter varies, the events on the way, and their curves "
        "in two parameters. [Branches and bifurcations](../branches.md) shows them at work.",
        "nonsmooth",
        "continue_orbit continue_equilibrium orbit.Branch orbit.BranchEvent orbit.FarSide orbit.BranchEnd "
        "continue_bifurcation orbit.BifurcationCurve orbit.CodimensionTwo orbit_functions orbit.OrbitFunctions "
        "orbit.OrbitFunction find_homoclinic orbit.Connection",
    ),
    "reachable_sets": _task(
        "Follow sets of orbits",
        "The forward-reachable set of a point where uniqueness fails, and the orbits that approach a "
        "special point or leave it.",
        "nonsmooth",
        "orbit.funnel orbit.Funnel manifold orbit.Manifold orbit.DividingCurves orbit.DividingArc "
        "orbit.ComputedStarts",
    ),
    "proofs": _task(
        "Prove",
        "Theorems in interval arithmetic, by the extra `proofs` (python-flint). "
        "[Proofs](../proofs.md) says what a proof rests on.",
        "nonsmooth",
        "certify proofs.Proof proofs.Enclosure prove_all proofs.Census certify_orbit proofs.OrbitProof",
    ),
    "bounce_shot": _task(
        "One bounce",
        "From touch-down to lift-off: slip, rolling, forces, and derivatives of the lift-off.",
        "bounce",
        "simulate explore Shot shot.Phase shot.Forces shot.State BounceStatus sensitivity shot.Sensitivity certify "
        "shot.BounceProof",
    ),
    "bounce_models": _task(
        "What the surface is",
        "A contact model is a normal and a tangential force; friction is one of the laws below. "
        "[Write your own contact model](../contact_model.md) shows how.",
        "bounce",
        "ContactModel contact.Contact3D KelvinVoigt NormalKelvinVoigt contact.DepthDampedKelvinVoigt Hertz "
        "contact.HuntCrossley contact.Tsuji contact.KuwabaraKono contact.Maxwell GeneralisedContact "
        "contact.Conditions contact.Condition contact.FrictionLaw contact.Coulomb contact.Stribeck "
        "contact.ExponentialDecay contact.Viscous contact.LuGre contact.Dahl",
    ),
    "bounce_maps": _task(
        "Many bounces, and what divides them",
        "Arrays of landings, maps of outcomes, and the curve that divides forward from reverse slip.",
        "bounce",
        "lift_off maps.LiftOffs outcome_map maps.OutcomeMap maps.proven_map maps.ProvenMap dividing_curve "
        "maps.DividingCurve maps.Arc maps.dividing_surface maps.DividingSurface maps.critical_eta slip_map "
        "maps.SlipMap maps.find_vortices maps.winding_number maps.Vortex maps.slip_turn maps.SlipTurn",
    ),
    "bounce_units": _task(
        "Metres and seconds",
        "Balls and landings in SI units, and the scales between them and the models without units.",
        "bounce",
        "Ball Landing Scaling",
    ),
}

#: Exceptions and warnings, by package.
ERRORS = (
    "nonsmooth",
    "nonsmooth.orbit",
    "nonsmooth.proofs",
    "bounce",
    "bounce.golf",
)

#: Golf has two tasks.
GOLF = {
    "bounce_golf": _task(
        "From launch to rest",
        "Flight, bounces and roll of a golf ball in SI units.",
        "bounce.golf",
        "flight Flight Air TourAverage tour_differences rebound Rebound play Run Bounce Glide landing_map SideState axis_spin AxisSpin",
    ),
    "bounce_fits": _task(
        "Fit measured bounces",
        "Read a table of measured bounces and find the parameters of a model that agree best.",
        "bounce.golf",
        "read_measurements Measurements fit FitResult Start",
    ),
}
