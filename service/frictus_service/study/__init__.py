"""`study/1`: the file that measurements are exchanged in, one file with many trials."""
