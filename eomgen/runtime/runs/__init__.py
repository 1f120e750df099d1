"""A BoundModel and what happens to it over time -> trajectories, their events and sensitivities."""
