"""The sweep of the guide."""

import nutdamp

spacecraft = nutdamp.load("spacecraft.yaml")
for angle in (1, 3, 5):
    case = spacecraft.with_(state={"nutation": f"{angle} deg"}, limits={"horizon": "300 s"})
    plan = nutdamp.plan(case, "two-pulse")
    print(f"{angle} deg: {plan.propellant:.5f} kg of propellant")
