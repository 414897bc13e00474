!> What the force loops keep between evaluations, beside the families, which they only read: what is
!> made of the model (tables of weights, what it gives each slot), and what one pass leaves for the
!> next. The owner of the model owns the workspace (`pd_motion_system`); another model takes another
!> one.
module pd_force_workspace
  use pd_base_kinds, only: wp, sp, i1, i4, i8
  use pd_base_lanes, only: lanes
  use pd_base_text, only: to_text
  use pd_force_model, only: model_type
  implicit none (type, external)
  private
  public :: workspace_type, lattice_workspace_type, list_workspace_type, weights_type, singles_type
  public :: composite_workspace_type, generic_workspace_type
  public :: at_volume, at_p
  public :: all_blocks, early_blocks, late_blocks

  !> Which blocks of a lattice or clusters of a list a pass takes: all, or those that need nothing
  !> of copies of other ranks' points and then, in a call of its own, the others.
  integer, parameter :: all_blocks = 0, early_blocks = 1, late_blocks = 2

  !> Where the volume stands in `place`, behind the position, and p in `moved`, behind the
  !> displacement.
  integer, parameter :: at_volume = 4, at_p = 4

  !> Weights of the bonds of one block, or of many that are alike, in the order of `offsets_type`.
  !> Families in mixed precision keep the single ones; lengths are those of their blocks.
  type :: weights_type
    integer :: n = 0                           !! offsets that any lane has
    integer :: n_forward = 0                   !! forward ones among them, which come first
    integer(i4), allocatable :: offset(:)      !! their numbers (n)
    integer(i8), allocatable :: shift(:)       !! their shifts (n)
    real(wp), allocatable :: geometry(:, :)    !! their geometry (4, n)
    real(wp), allocatable :: dilatation(:, :)  !! Gd v_c V_j (block_length, n)
    real(wp), allocatable :: stretch(:, :)     !! (q_k + q_j) Gb v_c V_j |xi| (block_length, n)
    real(sp), allocatable :: single_geometry(:, :)
    real(sp), allocatable :: single_dilatation(:, :) !! over the unit of volume (`volume_unit`)
    real(sp), allocatable :: single_stretch(:, :)
  end type weights_type

  !> What the loops in mixed precision work on.
  type :: singles_type
    real(wp) :: volume = 1.0_wp                !! unit of volume, a power of 2 [m3]
    real(sp), allocatable :: high(:, :)        !! leading digits of u (n_slots, dim), scaled
    real(sp), allocatable :: low(:, :)         !! the digits that follow
    real(sp), allocatable :: p(:)              !! p times the unit of volume (n_slots)
    real(sp), allocatable :: sums(:, :)        !! what is added to both ends (n_slots, dim), 3D
  end type singles_type

  !> Of a lattice family. Blocks without a table make their weights in every pass.
  type :: lattice_workspace_type
    integer(i8) :: room = 256_i8*1024_i8**2    !! that tables may always take [bytes]
    integer(i4), allocatable :: weights(:)     !! which table each block has; 0: none
    type(weights_type), allocatable :: table(:)
    integer(i1), allocatable :: formulas_used(:)  !! range of the fast formulas of each block in the
                                                  !! last dilatation pass, 0: none
    type(singles_type) :: singles              !! in mixed precision
    ! of substeps (`pd_motion_substeps`), which take some of the blocks at a time
    integer(i1), allocatable :: part(:)        !! of the blocks, in which each one is; not
                                               !! allocated: passes take all blocks
    integer(i1) :: due(2) = [0_i1, 0_i1]       !! first and last part that passes take
    logical :: onto = .false.                  !! forces are added to what is there
  end type lattice_workspace_type

  !> Of a list family. Made by the first pass, if nobody has (`prepare_list`).
  type :: list_workspace_type
    integer :: least_shared = 8                !! clusters that tables are made for, if they share
                                               !! them; tests take fewer or more
    integer(i8) :: key_bits = not(0_i8)        !! bits of keys that count: all, but in tests
    real(wp), allocatable :: place(:, :)       !! of each slot, side by side: position and volume
    real(wp), allocatable :: moved(:, :)       !! displacement and p of the pass (4, n_slots)
    real(wp), allocatable :: given(:, :)       !! what the model gives each slot (8, n_slots), and
    integer(i1), allocatable :: plain(:)       !! 1 for clusters where all of that is alike
                                               !! (`pd_force_list_points`)
    integer(i8), allocatable :: stored(:)      !! the place of each cluster's first pack in
    real(wp), allocatable :: weight_D(:, :)    !! Gd vc V_j and
    real(wp), allocatable :: weight_S(:, :)    !! (q_k + q_j) Gb vc V_j |xi| (lanes, packs),
                                               !! of all bonds, intact or not; 0: has none
    integer(i8), allocatable :: shape(:)       !! that of its first column in
    real(wp), allocatable :: geometry(:, :)    !! xi and 2/|xi|^2 (lanes, columns of each pack)
    integer(i1), allocatable :: large(:)       !! how far clusters were strained in the last pass
  end type list_workspace_type

  !> Of the generic pass, on any family (`pd_force_generic_pass`). Values of bonds are in the order
  !> of `bonds_of`.
  type :: generic_workspace_type
    integer(i8), allocatable :: start(:)       !! first bond of each slot (n_slots + 1)
    integer(i8), allocatable :: partner(:)     !! the same bond at its other end
    integer(i4), allocatable :: member(:)      !! slot of that
    real(wp), allocatable :: volume(:)         !! vc V_j, 0 where the bond is broken [m3]
    real(wp), allocatable :: x(:, :)           !! positions (n_slots, dim) [m]
    real(wp), allocatable :: pull(:)           !! the slot's own part of each pair force density at
                                               !! the displacements of the last pass [N/m6]
    real(wp), allocatable :: history(:, :)     !! of each ordered bond (reals, bonds)
    real(wp), allocatable :: of_point(:, :)    !! of each slot (reals, n_slots)
    real(wp), allocatable :: constants(:, :)   !! that the laws have made (reals, n_slots)
  end type generic_workspace_type

  !> Of a composite family: what stands in the slots of its list.
  type :: composite_workspace_type
    type(model_type) :: model                  !! parameters of these slots
    real(wp), allocatable :: u(:, :)           !! displacements (slots of the list, dim) [m]
    real(wp), allocatable :: p(:)              !! 2 a d delta theta; its size is 0 without one
    real(wp), allocatable :: force(:, :)       !! force densities [N/m3]
    integer(i1), allocatable :: strained(:)    !! marks; their number is 0 if no bond can break
  end type composite_workspace_type

  !> Of any family: the part that its loops use is filled, the others are empty.
  type :: workspace_type
    type(lattice_workspace_type) :: lattice
    type(list_workspace_type) :: list
    type(generic_workspace_type) :: generic
    type(composite_workspace_type) :: composite
  contains
    procedure :: bytes
    procedure :: describe
  end type workspace_type

contains

  !> Memory of tables, and of what is kept of blocks, clusters and slots [bytes].
  pure integer(i8) function bytes(workspace)
    class(workspace_type), intent(in) :: workspace  !! of any family

    bytes = bytes_of_lattice(workspace%lattice) + bytes_of_list(workspace%list) &
      & + bytes_of_generic(workspace%generic)
    if (allocated(workspace%composite%u)) bytes = bytes + 16*size(workspace%composite%u, kind=i8) &
      & + 8*size(workspace%composite%p, kind=i8) + size(workspace%composite%strained, kind=i8)
  end function bytes

  pure integer(i8) function bytes_of_lattice(workspace) result(bytes)
    type(lattice_workspace_type), intent(in) :: workspace
    integer :: t

    bytes = 0_i8
    if (allocated(workspace%weights)) bytes = bytes + 4_i8*size(workspace%weights)
    associate (s => workspace%singles)
      if (allocated(s%high)) bytes = bytes + 4_i8*(2*size(s%high) + size(s%p) + size(s%sums))
    end associate
    if (.not. allocated(workspace%table)) return
    do t = 1, size(workspace%table)
      bytes = bytes + workspace%table(t)%n*(16_i8*lanes &
        & + merge(60, 44, allocated(workspace%singles%high)))
    end do
  end function bytes_of_lattice

  pure integer(i8) function bytes_of_list(workspace) result(bytes)
    type(list_workspace_type), intent(in) :: workspace

    bytes = 0_i8
    if (.not. allocated(workspace%given)) return
    bytes = 8*(size(workspace%place, kind=i8) + size(workspace%moved, kind=i8) &
      & + size(workspace%given, kind=i8) &
      & + size(workspace%weight_D, kind=i8) + size(workspace%weight_S, kind=i8) &
      & + size(workspace%geometry, kind=i8)) + 18_i8*size(workspace%large)
  end function bytes_of_list

  pure integer(i8) function bytes_of_generic(workspace) result(bytes)
    type(generic_workspace_type), intent(in) :: workspace

    bytes = 0_i8
    if (.not. allocated(workspace%start)) return
    bytes = 28*size(workspace%pull, kind=i8) + 8*(size(workspace%start, kind=i8) &
      & + size(workspace%x, kind=i8) + size(workspace%history, kind=i8) &
      & + size(workspace%of_point, kind=i8) + size(workspace%constants, kind=i8))
  end function bytes_of_generic

  !> How many tables there are, to follow the family's own description; empty where nobody counts
  !> them.
  pure function describe(workspace) result(text)
    class(workspace_type), intent(in) :: workspace  !! of any family
    character(:), allocatable :: text

    text = ''
    if (allocated(workspace%lattice%table)) text = '; points have '// &
      & to_text(size(workspace%lattice%table))//' different surroundings'
  end function describe

end module pd_force_workspace
