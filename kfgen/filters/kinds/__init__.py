"""The filters that linearise: each reads as its book page."""
