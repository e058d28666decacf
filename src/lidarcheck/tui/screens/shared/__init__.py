"""What several screens have: what every screen is, and KPIs as lines."""
