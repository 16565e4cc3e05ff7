"""The paper's figures and tables, computed again and compared with the published values.

The paper is B. Quaife, S. Veerapaneni and Y.-N. Young, Hydrodynamics and rheology of a vesicle doublet
suspension, Phys. Rev. Fluids (2019).  `ensemble/README.md` says how to add a section.
"""
