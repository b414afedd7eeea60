"""Controllers that vendors deliver as IEEE/CIGRE DLLs (CIGRE TB 958, IEEE P3597), made into FMUs."""
