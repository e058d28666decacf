"""The kinds of KPI that a scenario can ask for, and which echoes and beams each looks at."""
