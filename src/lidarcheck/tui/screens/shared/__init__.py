"""What several screens have: what every screen is, work beside the interface, KPIs as lines."""
