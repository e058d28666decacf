"""What a run of the gate says to machines: results, JUnit, annotations."""
