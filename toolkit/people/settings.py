"""How people are found, told apart and kept apart."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PeopleSettings:
    """Sizes of people and rooms. Metres, seconds and square metres seen head on, unless said otherwise.

    Attributes
    ----------
    coarse_width : pixels of the image in which people are looked for; a head of 0.16 m is 7 pixels wide at 3 m
    surface_gap : depth between neighbouring coarse pixels of one surface, on top of the quantisation: a side of a
        torso that falls off by 70 degrees at 3 m
    bridge_cut, bridge_room : largest depth step over which pixels still belong together. Where nothing but people is
        measured, an arm before the chest; in a room, less than what separates a person from a shelf behind
    bridge_cost : how many times as long as a step on the surface that one counts
    upright_cost : how many times as long a vertical step counts as a horizontal one when people share pixels
    reach : horizontally from head to fingertip of a tall adult, leaning
    reach_still : the same where nothing moved so far: a seated person's knees; more would be the chair
    reach_up : from the head's centre to the fingertip of a raised arm
    reach_down : from the head's centre to the sole of a person of 2.1 m
    longest_way : over the surface from head to toe or fingertip
    head_score : of 1, which a head must reach
    head_distance : between two heads; shoulder to shoulder, cheek to cheek
    shoulder_distance, least_drop : horizontally and downwards from a head, within and beyond which what looks like a
        head is a shoulder
    body_distance, head_drop : of the axis, within which what lies lower than `head_drop` is an elbow or a knee
    knee_reach : horizontally, within which what lies more below a head than beside it, on the surface that hangs on the
        head, is a knee (of one who sits, 0.55 m below) or the back of one who leans
    least_area : of a person: head and chest of a child that a table cuts off
    least_cut_out : of a person where nothing but people is measured: one of half a metre
    least_height : of a person: head and chest of a child
    least_part : of a known person: a shoulder beside another person
    least_body : of a person whose head is not seen
    least_island, largest_island : of an unassigned component that is given to a person: half a hand, an arm with
        its hand or a leg
    island_gap : from such a piece to the person (Baak 2013, 5.4.2)
    torso : horizontally from the head's axis, of what stays a person's from frame to frame
    same_surface : depth by which a surface moves from frame to frame: 5 m/s at 30 Hz
    body_gate : from a measured point to the surface of the body that it belongs to
    patience : during which an unseen person is expected at their last place
    plane_area, plane_side : the least of a wall or a floor; no person shows a plane of this size
    plane_distance : of a pixel from such a plane, on top of the quantisation
    mirror_depth, mirror_gate : a head so far behind a wall, and so close to the mirror image of one before it
        mirrored, is that mirror image: walls are known to a few degrees
    most_people : that are told apart; later ones are left out
    """

    coarse_width: int = 160
    surface_gap: float = 0.05
    bridge_cut: float = 0.5
    bridge_room: float = 0.12
    bridge_cost: float = 3.0
    upright_cost: float = 0.5
    reach: float = 1.1
    reach_still: float = 0.6
    reach_up: float = 0.85
    reach_down: float = 2.0
    longest_way: float = 2.5
    head_score: float = 0.8
    head_distance: float = 0.25
    shoulder_distance: float = 0.3
    body_distance: float = 0.45
    least_drop: float = 0.1
    head_drop: float = 0.5
    knee_reach: float = 0.75
    least_area: float = 0.06
    least_cut_out: float = 0.03
    least_height: float = 0.35
    least_part: float = 0.02
    least_body: float = 0.12
    least_island: float = 0.003
    largest_island: float = 0.15
    island_gap: float = 0.5
    torso: float = 0.25
    same_surface: float = 0.15
    body_gate: float = 0.12
    patience: float = 1.0
    plane_area: float = 1.2
    plane_side: float = 0.9
    plane_distance: float = 0.03
    mirror_depth: float = 0.3
    mirror_gate: float = 0.4
    most_people: int = 16
