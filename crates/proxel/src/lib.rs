//! Proxel minimises deformation energies under constraints.
