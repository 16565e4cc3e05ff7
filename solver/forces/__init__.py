"""Forces on the membranes: bending, tension and adhesion."""
