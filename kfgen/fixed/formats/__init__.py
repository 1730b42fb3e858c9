"""Binary points: of what the user reads or writes, of the covariance, and what is kept below an LSB."""
