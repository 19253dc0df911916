"""Motion capture: clips, readers of BVH, ASF/AMC and AMASS, retargeting to the body, procedural motions.

Owns joint maps and length units of motion files. May import `toolkit.body` and the packages below it.
"""
