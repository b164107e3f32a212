"""Contact localisation: which link is touched, at which point and with what force, inferred from joint torques."""
