"""The mount of a screen: resonances from a hammer (impact) test."""
