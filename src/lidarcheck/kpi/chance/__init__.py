"""What chance gives: two scans' sides exchanged by whole units, and which KPIs stand out from that."""
