"""Make the shipped bank of tracks again: python -m noise (about 2 s)."""

from noise.bank import SHIPPED, BankKey, make_bank, write_bank

if __name__ == "__main__":
    write_bank(make_bank(BankKey()), SHIPPED)
