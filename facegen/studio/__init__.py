"""The studio: shape a face and rig an avatar in the browser."""
