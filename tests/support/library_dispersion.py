"""The example of the guide on goals and dispersed cases."""

import nutdamp

spacecraft = nutdamp.example()
plan = nutdamp.plan(spacecraft, "half-cone", target="3deg,45deg", spin="keep")
cases = nutdamp.disperse(nutdamp.plan(spacecraft, "two-pulse"), 2000)
print(cases.percentiles([50, 99.7])["nutation_deg"])
print(cases.to_numpy()["momentum_shift_deg"].max())
