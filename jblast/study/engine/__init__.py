"""What every study of millions needs: tiles of samples, devices, stores, going on."""
