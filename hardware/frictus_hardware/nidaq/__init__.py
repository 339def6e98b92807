"""The rig on an NI device (X Series on PCIe, PXI or USB), local or behind NI's gRPC server."""
