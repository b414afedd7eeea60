"""Points of a study: computed one after another, on the cores of a machine or on a cluster, and kept in a folder."""
