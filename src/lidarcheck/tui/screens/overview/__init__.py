"""The screen Overview: what is measured with its number, what each edit did, and the scenarios with their KPIs."""
