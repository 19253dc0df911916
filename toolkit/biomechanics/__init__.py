"""What tracks say about how somebody stands and walks: foot contacts, joint angles, gait, sit-to-stand."""
