//! The splitting engine of Proxel: problems, terms, ADMM, global steps, stops.
