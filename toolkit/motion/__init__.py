"""What tracks say about how a person stands and walks: foot contacts, joint angles, gait, sit-to-stand."""
