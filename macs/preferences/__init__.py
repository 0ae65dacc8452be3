"""What a person wants of the objectives: preferences that rank points, and that gradient solves minimise."""
