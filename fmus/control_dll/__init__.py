"""Control parts of our converters as IEEE/CIGRE DLLs (CIGRE TB 958, IEEE P3597), for EMT programs."""
