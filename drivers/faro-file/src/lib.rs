//! Scanner driver for FARO scan files: E57, PTX, XYZ, XYB.
