"""What stands between a commander and the arm."""

from pretouch.profiles import Profile, profile

FILTERS: dict[str, Profile] = {
    "pretouch": profile("pretouch"),
    "paper": profile("paper"),
    "none": profile("pretouch:approach=none:null_space=none"),
}
"""`none` sees what `pretouch` does, answers contacts as it does, and keeps the limits of the joints alone."""
