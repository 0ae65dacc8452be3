"""Single and multiple shooting by explicit Runge-Kutta steps."""
