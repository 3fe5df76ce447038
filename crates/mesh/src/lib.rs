//! Meshes of Proxel: topology, file formats, generators, checks.
