//! Ray-casting terrestrial laser scanner with a scene round the plate.
