"""Mathematics over traced or plain numbers; knows nothing of filters."""
