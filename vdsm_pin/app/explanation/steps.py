"""The seven steps of the paper at one waypoint, one function each."""

import numpy as np

from vdsm_pin.app.explanation import pictures
from vdsm_pin.app.explanation.cross import NAMES, Cross, crosses
from vdsm_pin.app.explanation.parts import Moment, Step, Table, at, deg, mm, name, table
from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import link_angles, position_angles
from vdsm_pin.planner.feasibility import curled_reach, straight_reach
from vdsm_pin.planner.paper.across_rail import AcrossRail
from vdsm_pin.planner.paper.along_rail import AlongRail
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.joint_paths import chain_ratios
from vdsm_pin.problem.desired_path import Approach
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

SCHEMES = {
    Approach.SHORTEST: "by the shortest way",
    Approach.EQUIDISTANT: "at an equidistant point",
    Approach.NEAREST_EQUIDISTANT: "at the nearest equidistant point",
}


def reach_step(moment: Moment) -> Step:
    """Step 1 (3.2, Eq. 4)."""
    problem = moment.plan.problem
    arm, path = problem.manipulator, problem.path
    places = np.vstack([path.start, path.points])
    farthest = float(np.hypot(places[:, 1], places[:, 2]).max())
    here = float(np.hypot(*moment.reference[-1]))
    return Step(
        "Step 1: can the path be reached?",
        "section 3.2, Eq. 4",
        (
            f"The path is at most {in_mm(farthest)} from the rail, the tip at this "
            f"waypoint {in_mm(here)}.",
            f"r_yz = Σ Lᵢ sin(min(i·ψ_max, 90°)) = {in_mm(curled_reach(arm))}: with "
            "every joint at its limit. The method keeps the arm straight where nothing "
            f"is in the way, and so reaches {in_mm(straight_reach(arm))}; both are "
            "tested.",
        ),
    )


def projection_step(moment: Moment) -> Step:
    """Step 2 (3.3)."""
    tip = moment.steps.route.tip_path.points[moment.row]
    return Step(
        "Step 2: from 3D to 2D",
        "section 3.3",
        (
            f"The base slides along x, so x is free: the tip {at(tip)} becomes "
            f"{name('P', len(moment.planar))} = {at(tip[1:])} in the plane Y₀Z₀.",
        ),
    )


def scaling_step(moment: Moment) -> Step:
    """Step 3 (3.4-3.5, Eq. 5, 6)."""
    arm = moment.plan.problem.manipulator
    last = arm.n_links + 1
    words = (
        f"The reference is the straight arm: Pᵢ = kᵢ,{last} {name('P', last)}, "
        f"with kᵢ,{last} the length up to joint i over the whole length."
    )
    if moment.plan.problem.scaling is not None:
        words = (
            "The reference is placed as `ratios` in the problem file asks for; kᵢ,"
            f"{last} are those of the straight arm, from which it comes."
        )
    made = pictures.canvas(moment, pictures.VIEWS["y"])
    pictures.chain(made, arm, moment.reference, "P")
    rows = [
        (name("P", i + 1), f"{arm.ratios[i]:.4f}", *map(mm, moment.reference[i]))
        for i in range(last)
    ]
    return Step(
        "Step 3: scale the tip's path to the joints",
        "sections 3.4, 3.5, Eq. 5, 6",
        (words,),
        (table(("", f"kᵢ,{last}", "y [mm]", "z [mm]"), rows),),
        (made.svg("the straight arm and the shadow of the obstacles"),),
    )


def route_step(moment: Moment) -> Step:
    """Step 4 (4.2)."""
    problem, route = moment.plan.problem, moment.steps.route
    tips = route.tip_path
    region, way = _tip_region(moment), tips.points[:, 1:]
    made = pictures.canvas(moment, pictures.VIEWS["y"], region, [way])
    made.line(way, "route")
    made.dot(way[0], "former", "start", beside=(-6.0, -6.0))
    made.dot(way[moment.row], "taken", f"waypoint {moment.row}")
    along = in_mm(float(tips.path_m[moment.row]))
    drawing = bool(tips.on_path[moment.row])
    state = f"draws the path, {along} along it"
    if not drawing:
        state = (
            f"is off the path, which it left or will join {along} along it; it steps "
            "back along x, most at mid-way"
        )
    words = [
        f"The path is joined {SCHEMES[problem.path.approach]} "
        f"(approach: {problem.path.approach.value}).",
        f"At waypoint {moment.row} of {len(tips.points) - 1} the tip {state}.",
    ]
    side = int(route.side[moment.row])
    if side:
        turn = "larger" if side > 0 else "smaller"
        words.append(
            "The arm passes the obstacle, on the side of the "
            f"{turn} polar angle about P₁."
        )
    words += [f"{note[:1].upper()}{note[1:]}." for note in route.notes]
    picture = made.svg("route of the tip, danger region of the tip")
    return Step(
        "Step 4: the path of the tip", "section 4.2", tuple(words), (), (picture,)
    )


def _tip_region(moment: Moment) -> list[DangerRegion]:
    avoidance = moment.steps.avoidance
    return [avoidance.region] if isinstance(avoidance, AlongRail) else []


def joints_step(moment: Moment) -> Step:
    """Step 5 (4.3, Eq. 8-10)."""
    title, source = "Step 5: the paths of the joints", "section 4.3, Eq. 8-10"
    avoidance = moment.steps.avoidance
    side = int(moment.steps.route.side[moment.row])
    if isinstance(avoidance, AlongRail) and side:
        rule, former = avoidance.rules[side], moment.steps.planar[moment.former]
        arm = moment.plan.problem.manipulator
        found = crosses(arm, rule, former, moment.planar)
        return Step(
            title,
            source,
            _cross_words(found, not rule.direction.any()),
            (_cross_table(moment, found),),
            pictures.cross_pictures(moment, found, avoidance.forbidden),
        )
    if isinstance(avoidance, AcrossRail) and (moment.planar != moment.reference).any():
        return _bend_part(moment, avoidance, title, source)
    words = "Nothing is in the way of the straight arm here: Pᵢ is the reference."
    return Step(title, source, (words,))


def _cross_words(found: tuple[Cross, ...], on_circles: bool) -> tuple[str, ...]:
    moved = [one for one in found if one.moved]
    line = "the circle about P₁" if on_circles else "one auxiliary line"
    agree = sum(one.taken == _nearest(one) for one in moved)
    return (
        "From the tip to the base, P′ᵢ = kᵢ,ᵢ₊₁ Pᵢ₊₁. Inside the danger region the "
        "horizontal and the vertical line through it meet the boundary in four points. "
        "The paper takes the one nearest to the former place of Pᵢ; here every joint "
        f"takes {line}, to the side on which the arm passes, which keeps the motion "
        "continuous.",
        f"{len(moved)} of {len(found)} joints are moved; for {agree} of these both "
        "rules take the same point."
        if moved
        else "No joint is inside here, so that none is moved.",
    )


def _nearest(one: Cross) -> str:
    return NAMES[one.nearest]


def _cross_table(moment: Moment, found: tuple[Cross, ...]) -> Table:
    ratios = chain_ratios(moment.plan.problem.manipulator)
    rows = []
    for one in found:
        points = [at(p) for p in one.points] if one.moved else ["outside"] + ["–"] * 3
        rows.append(
            (
                name("P", one.joint),
                f"{ratios[one.joint - 1]:.4f}",
                at(one.proportional),
                at(one.former),
                *points,
                _nearest(one) if one.moved else "–",
                one.taken if one.moved else "in proportion",
                at(one.place),
            )
        )
    head = ("", "kᵢ,ᵢ₊₁", "P′ᵢ", "before", "up", "down", "right", "left",
            "nearest", "taken", "Pᵢ")  # fmt: skip
    return table(head, rows)


def _bend_part(moment: Moment, rule: AcrossRail, title: str, source: str) -> Step:
    view = (0, 1 + rule.axis)
    arm, seen = moment.plan.problem.manipulator, list(view)
    made = pictures.canvas(moment, view, [rule.region])
    pictures.chain(made, arm, moment.centres[:, seen], "O")
    letter = "yz"[rule.axis]
    moves = (moment.planar - moment.reference)[:, rule.axis]
    joints = ", ".join(
        f"joint {bend} by {mm(float(moves[bend - 1]))} mm" for bend in rule.bends
    )
    rows = [
        (name("P", i + 1), at(moment.reference[i]), at(moment.planar[i]))
        for i in range(arm.n_links + 1)
    ]
    return Step(
        title,
        source,
        (
            f"The obstacle lies across the rail. Moved along {letter}: {joints}; as "
            "little as keeps the links out of the danger region. The joints before "
            "follow in proportion to P₁, those after in proportion to the tip.",
        ),
        (table(("", "reference", "Pᵢ"), rows),),
        (made.svg("the bent arm and the danger region"),),
    )


def lift_step(moment: Moment) -> Step:
    """Step 6 (4.4, Eq. 7)."""
    arm, centres = moment.plan.problem.manipulator, moment.centres
    drawn = []
    for word in ("side", "top"):
        view = pictures.VIEWS[word]
        made = pictures.canvas(moment, view)
        pictures.chain(made, arm, centres[:, list(view)], "O")
        drawn.append(made.svg(f"the arm from the {word}"))
    gaps = np.linalg.norm(np.diff(moment.planar, axis=0), axis=1)
    rows = [
        (
            str(i + 1),
            mm(arm.link_lengths[i]),
            mm(gaps[i]),
            mm(centres[i + 1, 0] - centres[i, 0]),
            at(centres[i]),
        )
        for i in range(arm.n_links)
    ]
    return Step(
        "Step 6: from 2D to 3D",
        "section 4.4, Eq. 7",
        (
            "Back from the tip, xᵢ = xᵢ₊₁ − √(Lᵢ² − |Pᵢ₊₁ − Pᵢ|²): every link keeps "
            f"its length, and the base comes to x₀ = {in_mm(float(centres[0, 0]))}.",
        ),
        (table(("link", "Lᵢ [mm]", "|Pᵢ₊₁ − Pᵢ|", "xᵢ₊₁ − xᵢ", "Oᵢ"), rows),),
        tuple(drawn),
    )


def angles_step(moment: Moment) -> Step:
    """Step 7 (5.1, 5.2, Eq. 2, 3, 11-21)."""
    arm, rows = moment.plan.problem.manipulator, moment.steps.trajectory
    alpha, theta = rows.alpha[moment.row], rows.theta[moment.row]
    psi, gamma = link_angles(alpha, theta), position_angles(alpha, theta)
    both = np.stack([alpha, 0.0 * alpha]), np.stack([theta, 0.0 * theta])
    lengths, straight = cable_lengths(arm, *both)
    angles = [
        (
            str(i + 1),
            *(deg(angle[i]) for angle in (theta, alpha, psi)),
            deg(gamma[i]) if psi[i] > TOLERANCES.changed_angle else "–",
        )
        for i in range(arm.n_links)
    ]
    cables = [
        (str(i + 1), *map(mm, lengths[i]), *map(mm, lengths[i] - straight[i]))
        for i in range(arm.n_links)
    ]
    head = ("link", "a [mm]", "b [mm]", "c [mm]", "a − straight", "b − straight",
            "c − straight")  # fmt: skip
    limit = float(np.rad2deg(arm.max_link_angle))
    return Step(
        "Step 7: joint angles and cable lengths",
        "sections 5.1, 5.2, Eq. 2, 3, 11–21",
        (
            "In the frame of the link before, a link points along (cos α cos θ, "
            "sin α cos θ, −sin θ); θ and α follow from the joint centres, ψ and γ from "
            f"them. ψ may be {limit:.1f}° at most.",
            f"{3 * arm.n_links} cables: those of link j run through the joints 1 to j.",
        ),
        (
            table(("joint", "θ [°]", "α [°]", "ψ [°]", "γ [°]"), angles),
            table(head, cables),
        ),
        (
            pictures.link_angle_bars(np.rad2deg(psi), limit),
            pictures.hole_circle(arm, lengths - straight),
        ),
    )
