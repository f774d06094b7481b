"""The example of the guide."""

import numpy

import nutdamp

spacecraft = nutdamp.load("spacecraft.yaml")
plan = nutdamp.plan(spacecraft, "two-pulse")
flight = plan.fly()
flight.to_csv("track.csv")

track = flight.to_numpy()  # fields are named as the columns of the CSV
print(numpy.asarray(plan)[["start_s", "on_time_s", "channel"]])
print(
    f"at most {track['nutation_deg'].max():.3f} deg, at the end {track['nutation_deg'][-1]:.1e} deg"
)
print(nutdamp.compare(spacecraft).recommended)
