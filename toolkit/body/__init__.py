"""Human body: kinematic chain, rotations, skinned mesh, shape space, joints of the Azure Kinect SDK.

Owns the pose vector and the body assets. May import `toolkit.io` and `toolkit.kernels`.
"""
