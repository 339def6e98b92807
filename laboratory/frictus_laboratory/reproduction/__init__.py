"""The paper, simulated and analysed blind."""
