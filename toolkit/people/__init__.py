"""Who is in view: the depth of each person, and the pixels that say nothing about them."""
