print("a stand-in for a sensor model that is not ours")
