"""What telemetry of a flight says of the spacecraft: estimates with their covariance, in SI and the axes of the file.

A `record.Record` holds what was measured, a `model.Model` predicts it from parameters, `fit.fit` estimates these.
"""
