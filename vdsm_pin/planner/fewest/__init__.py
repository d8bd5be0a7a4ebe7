"""Plans in any scene with few bent joints: one graph of sparse shapes.

How a plan is made: `strategy` tells the story, `explore` goes through its searches. A
`roadmap` of sparse `shapes` along a tip `route` is searched (`search`). Where it ends,
arms are grown: along the path (`growth`) or through openings (`tip_routes`,
`insertion`). A `judge` says what is clear. What was found is pulled straight and bends
fewer joints (`smoothing`). `vdsm_pin.planner.impossible` proves what nobody can draw.

Words of these modules:

* tip: a tip position at which arms are tried; layer: one of those on the desired path,
  in drawing order; station: arc length along the desired path.
* offset D_i: how far joint i's projection is from where the straight arm to the same
  tip has it; chart: tip and offsets together, in which motions are straight lines.
* knee: a joint whose link angle is not zero; shape: the offsets of an arm with few of
  them, at any tip; node: a shape at a tip that keeps limits and clearance.
* weights: what a strategy prefers among nodes; population: arms that are mutated and
  selected from layer to layer.
* start node: the node the motion starts from; connection: a motion off the path; leg: a
  run of nodes that is drawn, or a connection; sequence: all legs.
* corner: a place where the motion turns in the chart; row: a configuration of the
  trajectory.
* undrawable: proved that nobody can draw it; skipped: not drawn, for whatever reason.
"""
