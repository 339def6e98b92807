"""The regression problem: a base model, its nuisance parameters and candidate effects."""
